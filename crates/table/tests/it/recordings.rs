//! Recordings as loggers, brokers, receivers and programs of databases write them. What they hold is written out.

use super::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Cells, Dialect, Kind, Scale, Table};

fn lines(header: &str, count: usize, row: impl Fn(usize) -> String) -> String {
    (0..count).fold(header.to_owned(), |text, i| text + &row(i) + "\n")
}

fn not_opened(text: &str) -> String {
    let opened = open_said(text, &Dialect::default()).and_then(|mut table| table.find_time().map(|_| table));
    match opened {
        Ok(mut table) => refusal(&mut table),
        Err(error) => error.to_string(),
    }
}

fn times(table: &mut Table) -> Vec<String> {
    let scale = table.time().unwrap().1;
    rows(table).times.iter().map(|time| time.shown(scale, 0)).collect()
}

#[test]
fn a_table_above_another_is_not_left_out() {
    let first = lines("time,temp\n", 30, |i| format!("{i},{}.5", i % 7));
    let second = lines("\ntime,hum,pressure\n", 30, |i| format!("{i},{},{}", 40 + i % 5, 1000 + i));
    let message = not_opened(&(first.clone() + &second));
    assert!(message.contains("line 2") && message.contains("a table before another"), "{message}");
    // Of one width the second line of names is that of a further table, also where bad lines may be left out.
    let same = lines("\ntime,hum\n", 30, |i| format!("{i},{}", 40 + i % 5));
    let said = Dialect {
        skip_bad: 9,
        ..Dialect::default()
    };
    let mut table = open_said(&(first + &same), &said).unwrap();
    table.find_time().unwrap();
    let message = refusal(&mut table);
    assert!(message.contains("line 33") && message.contains("a further table begins here"), "{message}");
    // Settings are left out as before, with numbers or not.
    let settings = "Gain,2\nRange,5\nOffset,0.1\n".to_owned() + &lines("time,a,b\n", 30, |i| format!("{i},1,2"));
    assert_eq!(rows(&mut open(&settings)).rows, 30);
}

#[test]
fn a_temperature_is_no_time() {
    let text = lines("doy,T\n", 60, |i| format!("{:.4},{:.2}", 65.0 + i as f64 / 24.0, 20.0 + (i as f64 / 5.0).sin()));
    let mut table = open_said(&text, &Dialect::default()).unwrap();
    assert!(!table.find_time().unwrap());
    let mut table = open_said(&lines("T,x\n", 60, |i| format!("{},{}", i % 3, i)), &Dialect::default()).unwrap();
    assert!(!table.find_time().unwrap());
    for header in ["t,x\n", "T,x\n"] {
        let found = seconds(&rows(&mut open(&lines(header, 5, |i| format!("{i}.5,1")))));
        assert_eq!(found, [0.5, 1.5, 2.5, 3.5, 4.5]);
    }
}

#[test]
fn weeks_of_gps_and_their_seconds_are_dates() {
    // GPS week 2345 began on Sunday, 15 December 2024.
    for (header, unit) in [
        ("gps_week,gps_seconds,x\n", 1),
        ("Week,TOW,x\n", 1),
        ("GPS Week,GPS TOW [s],x\n", 1),
        ("week,iTOW,x\n", 1000),
        ("week,tow_ms,x\n", 1000),
    ] {
        let row = |i: usize| {
            let second = 86_400 * 7 - 2 + i;
            format!("{},{},{i}", 2345 + second / 604_800, second % 604_800 * unit)
        };
        let mut table = open(&lines(header, 4, row));
        assert_eq!(table.time().unwrap().1, Scale::Local);
        let expected = [
            "2024-12-21T23:59:58",
            "2024-12-21T23:59:59",
            "2024-12-22T00:00:00",
            "2024-12-22T00:00:01",
        ];
        assert_eq!(times(&mut table), expected, "{header}");
    }
    let message = not_opened(&lines("week,tow,x\n", 4, |i| format!("297,{i},1")));
    assert!(message.contains("modulo 1024"), "{message}");
    assert!(not_opened(&lines("week,tow,x\n", 4, |i| format!("2345,{},1", 604_799 + i))).contains("is not a time"));
}

#[test]
fn hours_with_a_letter_behind() {
    let clock = |i: usize| format!("{}h{:02}", 9 + i / 4, 15 * (i % 4));
    let found = seconds(&rows(&mut open(&lines("time,x\n", 9, |i| format!("{},1", clock(i))))));
    assert_eq!(found[..2], [32_400.0, 33_300.0]);
    let mut table = open(&lines("date,heure,x\n", 9, |i| format!("2024-03-15,{},1", clock(i))));
    assert_eq!(times(&mut table)[8], "2024-03-15T11:00:00");
    let mut table = open(&lines("quand;x\n", 9, |i| format!("15/03/2024 {};1", clock(i))));
    assert_eq!(times(&mut table)[1], "2024-03-15T09:15:00");
}

#[test]
fn quotes_behind_backslashes() {
    let words = |line: &str| {
        let text = "time,note,x\n0,plain,1\n1,plain,2\n2,plain,3\n".to_owned() + line + "\n";
        let table = open(&text);
        let survey = table.survey().unwrap();
        let mut table = open(&text);
        table.use_survey(&survey);
        assert_eq!(table.columns()[1].kind, Kind::Words);
        let batch = rows(&mut table);
        let Cells::Words(found) = &batch.columns[0] else {
            panic!("no words")
        };
        (table.words(1)[found[3].unwrap() as usize].clone(), numbers(&batch.columns[1])[3])
    };
    assert_eq!(words(r#"3,"a \"b\" c, d",4"#), ("a \"b\" c, d".to_owned(), Some(4.0)));
    assert_eq!(words(r#"3,"a \"b\", c",4"#), ("a \"b\", c".to_owned(), Some(4.0)));
    assert_eq!(words(r#"3,"C:\logs\",4"#), (r"C:\logs\".to_owned(), Some(4.0)));
    assert_eq!(words(r#"3,"C:\""logs""",4"#), (r#"C:\"logs""#.to_owned(), Some(4.0)));
}

#[test]
fn line_protocol_and_topics() {
    let text = "# DML\n".to_owned()
        + &lines("", 9, |i| {
            format!(
                r#"air\ box,site=roof\,\ north t={i}.5,n={i}i,ok=t,s="a, \"b\" = c" {}"#,
                1_710_000_000_000_000_007 + i * 1_000_000_000
            )
        });
    let table = open(&text);
    let survey = table.survey().unwrap();
    let mut table = open(&text);
    table.use_survey(&survey);
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["measurement", "site", "t", "n", "ok", "s", "time"]);
    assert_eq!(table.words(0), ["air box"]);
    assert_eq!(table.words(1), ["roof, north"]);
    assert_eq!(table.words(5), [r#"a, "b" = c"#]);
    let batch = rows(&mut table);
    assert_eq!(numbers(&batch.columns[2])[8], Some(8.5));
    assert_eq!(batch.times[1].shown(Scale::Utc, 9), "2024-03-09T16:00:01.000000007Z");
    assert!(not_opened(&(text + "air t=1.5.2 5\n")).contains("not a line of InfluxDB's protocol"));

    let text = lines("", 5, |i| format!(r#"home/{} {{"time":{i},"t":{i}.5}}"#, i % 2));
    let mut table = open(&text);
    assert_eq!(
        table
            .columns()
            .iter()
            .map(|column| column.name.as_str())
            .collect::<Vec<_>>(),
        ["topic", "time", "t"]
    );
    assert_eq!(numbers(&rows(&mut table).columns[1])[4], Some(4.5));
    let mut table = open(&(text + "home/1 offline\n"));
    assert!(refusal(&mut table).contains("line 6"));
}

#[test]
fn lines_of_marks_counts_and_comments() {
    let body = lines("", 5, |i| format!("| {i} | {i}.5 |"));
    for rule in ["|---|---|", "| --- | --- |", "|:---|---:|"] {
        let batch = rows(&mut open(&format!("| time | x |\n{rule}\n{body}")));
        assert_eq!(seconds(&batch), [0.0, 1.0, 2.0, 3.0, 4.0], "{rule}");
    }
    let body = lines("", 5, |i| format!(" 2024-03-15 09:0{i}:00 | {i}.5"));
    assert_eq!(
        rows(&mut open(&format!("        time         |  x\n---------------------+-----\n{body}(5 rows)\n\n"))).rows,
        5
    );
    let table = |mark: &str| format!("{mark} logger\n{mark} roof\n") + &lines("time,x\n", 5, |i| format!("{i},{i}.5"));
    for mark in ["//", "%"] {
        let text = table(mark) + &format!("{mark} restart\n9,9.5\n");
        assert_eq!(rows(&mut open(&text)).rows, 6, "{mark}");
    }
    // Below the first lines such a line may be a row with a fault, so that it is asked for.
    let message = not_opened(&(lines("time,x\n", 50, |i| format!("{i},{i}.5")) + "// restart\n"));
    assert!(message.contains("--comment //"), "{message}");
    // A list's lines end in commas.
    let text = lines("", 5, |i| format!("{{\"time\":{i},\"x\":{i}.5}},"));
    assert_eq!(numbers(&rows(&mut open(&text)).columns[0])[4], Some(4.5));
    // Marks of quality are no words.
    let message = not_opened(&lines("time,x\n", 60, |i| format!("{i},{i}.5{}", if i % 4 == 0 { "" } else { "*" })));
    assert!(message.contains("--strip-units"), "{message}");
}

#[test]
fn numbers_that_lost_a_part() {
    for cell in ["1.70963E+12", "1.70963E+09", "1,70963E+12"] {
        let message = not_opened(&lines("time;x\n", 9, |i| format!("{cell};{i}")));
        assert!(message.contains("lost its last digits"), "{cell}: {message}");
    }
    let mut table = open(&lines("time,x\n", 9, |i| format!("1.709632680{i}E+09,{i}")));
    assert_eq!(seconds(&rows(&mut table))[1], 1_709_632_680.1);
    let message = not_opened(&lines("time,x\n", 9, |i| format!("{i},\"1,234,00{i}\"")));
    assert!(message.contains("say --thousands ,") && !message.contains("--decimal"), "{message}");
    // A share of 1 among shares of a hundred.
    let said = Dialect {
        strip_units: true,
        ..Dialect::default()
    };
    let text = lines("time,x\n", 9, |i| {
        if i == 4 {
            "4,0.5".to_owned()
        } else {
            format!("{i},{}%", i * 10)
        }
    });
    let message = refusal(&mut open_said(&text, &said).unwrap());
    assert!(message.contains("line 6") && message.contains("`0.5` has no `%`"), "{message}");
    let text = lines("time,x\n", 9, |i| {
        if i == 4 {
            "4,0".to_owned()
        } else {
            format!("{i},{i}.5{}", ["%", " %"][i % 2])
        }
    });
    assert_eq!(numbers(&rows(&mut open_said(&text, &said).unwrap()).columns[1])[4], Some(0.0));
    let text = lines("time,x\n", 9, |i| format!("{i},{i}.5{}", ["", "*"][i % 2]));
    assert_eq!(numbers(&rows(&mut open_said(&text, &said).unwrap()).columns[1])[4], Some(4.5));
}
