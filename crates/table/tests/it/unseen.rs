//! Tables in shapes of further loggers and programs: read right, or refused with the option that decides. None is read in silence as
//! something else.

use super::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Error, Kind, Scale, Table};

fn said() -> Dialect {
    Dialect::default()
}

/// The refusal of a table when it is opened or its time is looked for.
fn not_opened(text: &str) -> String {
    let opened: Result<Table, Error> = open_said(text, &said()).and_then(|mut table| {
        table.find_time()?;
        Ok(table)
    });
    match opened {
        Ok(mut table) => refusal(&mut table),
        Err(error) => error.to_string(),
    }
}

fn lines(header: &str, row: impl Fn(usize) -> String) -> String {
    (0..20).fold(header.to_owned() + "\n", |text, i| text + &row(i) + "\n")
}

fn times(text: &str) -> Vec<String> {
    let mut table = open(text);
    let (_, scale) = table.time().unwrap();
    rows(&mut table).times.iter().map(|time| time.shown(scale, 0)).collect()
}

#[test]
fn rows_with_a_fault_are_no_names() {
    for fault in ["ERR", "true", "low"] {
        let text = format!("time,x\n0,{fault}\n1,5.5\n2,6.5\n3,7.5\n4,8.5\n");
        let table = open(&text);
        assert_eq!(table.columns()[1].name, "x", "{fault}");
        assert!(not_opened(&text).contains(&format!("line 2 (row 1), column `x`: `{fault}`")), "{fault}");
    }
    // Names that are numbers, below settings that are none.
    let mut table = open("Station,West\ntime,2021,2022\n0,1,2\n1,3,4\n2,5,6\n");
    assert_eq!(rows(&mut table).rows, 3);
    assert_eq!(table.columns()[1].name, "2021");
}

#[test]
fn words_among_numbers_are_all_known() {
    let text = lines("time,code", |i| format!("{i},{}", ["0007", "7", "1E5", "A1", "B2", "C3", "D4"][i % 7]));
    let survey = open(&text).survey().unwrap();
    assert_eq!(survey.columns[1].kind(), Kind::Words);
    let mut table = open(&text);
    table.use_survey(&survey);
    let known = table.words(1).to_vec();
    assert_eq!(known, ["0007", "1E5", "7", "A1", "B2", "C3", "D4"]);
    // Reading finds no others: what a recording states before the first row is complete.
    rows(&mut table);
    assert_eq!(table.words(1), known);
    // With too many words by the numbers alone, the column is text.
    let many = (0..900).fold("time,code\n".to_owned(), |text, i| {
        text + &format!("{i},{}\n", if i < 300 { format!("{i}") } else { format!("A{}", i % 2) })
    });
    assert_eq!(open(&many).survey().unwrap().columns[1].kind(), Kind::Text);
}

#[test]
fn numbers_of_other_spellings_are_no_words() {
    for (cell, mend) in [
        ("1\u{2019}000.25", "--thousands"),
        ("1_000", "--thousands _"),
        ("1.5-", "minus"),
        ("0x1f", "hexadecimal"),
        ("\u{ff11}\u{ff12}", ""),
        ("1\u{bd}", ""),
    ] {
        let message = not_opened(&lines("time,x", |i| format!("{i},{cell}")));
        assert!(message.contains("is not a number") && message.contains(mend), "{cell}: {message}");
    }
    let apostrophes = Dialect {
        thousands: Some('\''),
        ..said()
    };
    let mut table = open_said("a,x\nb,1\u{2019}000.25\nb,1'000.5\n", &apostrophes).unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[1]), [Some(1000.25), Some(1000.5)]);
    // Marks without ink, and the sign of infinity.
    let mut table = open("time,x\n0,\u{a0}1.5\u{a0}\n1,\u{200b}2.5\n2,\u{221e}\n3,-\u{221e}\n");
    let found = numbers(&rows(&mut table).columns[0]);
    assert_eq!(found, [Some(1.5), Some(2.5), Some(f64::INFINITY), Some(f64::NEG_INFINITY)]);
    // A minus of typography does not hide decimal commas.
    let mut table = open("Tid;Temp\n2024-03-05 10:00;\u{2212}20,5\n2024-03-05 11:00;\u{2212}21,5\n");
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(-20.5), Some(-21.5)]);
}

#[test]
fn points_that_may_group_digits_are_asked_for() {
    let text = lines("t;flow", |i| {
        let flow = 500 + 100 * i;
        let text = flow.to_string();
        format!(
            "{i};{}",
            if flow < 1000 {
                text
            } else {
                format!("{}.{}", &text[..text.len() - 3], &text[text.len() - 3..])
            }
        )
    });
    let message = not_opened(&text);
    assert!(
        message.contains("`1.000`") && message.contains("--thousands .") && message.contains("--decimal ."),
        "{message}"
    );
    let grouped = Dialect {
        thousands: Some('.'),
        decimal: Some(','),
        ..said()
    };
    let mut table = open_said(&text, &grouped).unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[1])[5], Some(1000.0));
    // Decimals of a fixed number, and of any.
    for numbers in [["1.000", "999.125", "500.000"], ["100", "1.5", "1.125"]] {
        open(&lines("t;flow", |i| format!("{i};{}", numbers[i % 3])));
    }
    // A comma before three digits in quotes is likelier a group.
    let message = not_opened(&lines("t,x", |i| format!("{i},\"1,{i:03}\"")));
    assert!(message.contains("--thousands ,"), "{message}");
}

#[test]
fn units_of_one_column_are_one() {
    let strip = Dialect {
        strip_units: true,
        ..said()
    };
    let mut table = open_said("time,p\n0,5 W\n1,6 W\n2,7\n3,8 kW\n4,9 W\n", &strip).unwrap();
    table.find_time().unwrap();
    let message = refusal(&mut table);
    assert!(message.contains("line 5 (row 4), column `p`: `8 kW` has another unit"), "{message}");
    let survey = open_said("time,p\n0,5 W\n1,6 W\n3,8 kW\n4,9 W\n", &strip)
        .unwrap()
        .survey()
        .unwrap();
    assert_eq!(survey.columns[1].suspicious(), 1);
}

#[test]
fn usual_sentinels_are_named_however_many() {
    for (sentinel, share) in [(-9999.0, 3), (999.9, 4), (-999.0, 2)] {
        let text = lines("time,x", |i| {
            format!(
                "{i},{}",
                if i % share == 0 {
                    sentinel
                } else {
                    20.0 + 0.25 * i as f64
                }
            )
        });
        let survey = open(&text).survey().unwrap();
        assert_eq!(survey.columns[1].sentinel().map(|found| found.value), Some(sentinel));
        assert!(
            survey.columns[1]
                .few()
                .is_some_and(|few| few.most.0 >= 20.0 && few.most.1 <= 25.0)
        );
    }
    assert_eq!(
        open(&lines("time,x", |i| format!("{i},{}", [1, 2, 3, 500][i % 4])))
            .survey()
            .unwrap()
            .columns[1]
            .sentinel(),
        None
    );
}

#[test]
fn names_that_may_be_anything_are_no_times_beside_others() {
    for text in [
        lines("ts,t", |i| format!("{},{i}", 1_709_630_000 + i)),
        (0..20)
            .map(|i| format!("{{\"ts\":{},\"t\":{i}}}\n", 1_709_630_000 + i))
            .collect(),
        lines("sec,t,timestamp", |i| format!("{},{i},{}", 20 - i, 1_709_630_000 + i)),
    ] {
        assert_eq!(seconds(&rows(&mut open(&text)))[1], 1_709_630_001.0);
    }
}

#[test]
fn keys_that_stand_twice_are_refused() {
    for line in ["{\"ts\":1,\"t\":2,\"t\":3}", "{\"ts\":1,\"a.b\":2,\"a\":{\"b\":3}}"] {
        assert!(not_opened(&format!("{line}\n{line}\n")).contains("stands twice"), "{line}");
    }
}

#[test]
fn marks_of_encodings_within_joined_files_are_none_of_cells() {
    let part = |from: usize| (from..from + 5).fold(String::new(), |text, i| text + &format!("{i},{i}.5\n"));
    let text = format!("\u{feff}time,x\n{}\u{feff}time,x\n{}\u{feff}{}", part(0), part(5), part(10));
    let mut table = open(&text);
    let batch = rows(&mut table);
    assert_eq!((batch.rows, table.skipped().repeated), (15, 1));
    assert_eq!(seconds(&batch), (0..15).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn weeks_days_of_the_year_and_months_of_other_languages() {
    for (cell, expected) in [
        ("2024-W10-2", "2024-03-05T00:00:00"),
        ("2024W102", "2024-03-05T00:00:00"),
        ("2020-W53-7T21:30", "2021-01-03T21:30:00"),
        ("2024:065:21:30:00", "2024-03-05T21:30:00"),
        ("5 mars 2024 21:30", "2024-03-05T21:30:00"),
        ("05. M\u{e4}rz 2024 21:30", "2024-03-05T21:30:00"),
        ("05-ene-2024", "2024-01-05T00:00:00"),
        ("5 d\u{e9}c. 2024", "2024-12-05T00:00:00"),
        ("5 Oktober 2024", "2024-10-05T00:00:00"),
        ("5 ao\u{fb}t 2024", "2024-08-05T00:00:00"),
        ("13.03.2024 1:30 p. m.", "2024-03-13T13:30:00"),
        ("2024-03-05 21:30:00 Europe/Berlin", "2024-03-05T20:30:00Z"),
        ("2024-03-05 21:30:00 UTC", "2024-03-05T21:30:00Z"),
    ] {
        assert_eq!(times(&format!("time,x\n{cell},1\n")), [expected], "{cell}");
    }
    for cell in [
        "2024-W54-1",
        "2023-W53-1",
        "2024-W10-8",
        "2023:366:00:00:00",
        "5 foo 2024",
    ] {
        assert!(not_opened(&format!("time,x\n{cell},1\n{cell},1\n")).contains(cell), "{cell}");
    }
}

#[test]
fn a_date_and_the_hour_beside_it() {
    let hours = lines("Date,Hour,x", |i| format!("2024-03-05,{i},{i}"));
    assert_eq!(times(&hours)[5], "2024-03-05T05:00:00");
    // Hours that end: 24 is midnight.
    assert_eq!(
        times("Date,Hour,x\n2024-03-05,23,1\n2024-03-05,24,2\n"),
        ["2024-03-05T23:00:00", "2024-03-06T00:00:00"]
    );
    assert_eq!(
        times("Datum;Stunde;Minute;x\n13.03.2024;9;5;1\n13.03.2024;9;15;2\n"),
        ["2024-03-13T09:05:00", "2024-03-13T09:15:00"]
    );
    assert_eq!(
        times("DATE,HRMN,x\n20240305,0,1\n20240305,30,1\n20240305,930,2\n")[1..],
        ["2024-03-05T00:30:00", "2024-03-05T09:30:00"]
    );
    let mut table = open_said(&hours, &said()).unwrap();
    table.set_time(&["Date", "Hour"]).unwrap();
    assert_eq!(rows(&mut table).times[19].shown(Scale::Local, 0), "2024-03-05T19:00:00");
    for bad in ["2024-03-05,25,1", "2024-03-05,1.5,1"] {
        assert!(
            not_opened(&format!("Date,Hour,x\n2024-03-05,1,1\n2024-03-05,2,1\n{bad}\n")).contains("line 4"),
            "{bad}"
        );
    }
}

#[test]
fn numbers_of_days_are_no_seconds() {
    let message = not_opened(&lines("time,x", |i| format!("{:.6},{i}", 45_356.0 + i as f64 / 24.0)));
    assert!(message.contains("--time-format excel") && message.contains("--time-format s"), "{message}");
    // Seconds of a logger of that size have fewer decimals.
    assert_eq!(seconds(&rows(&mut open("time,x\n45356.25,1\n45356.5,2\n")))[1], 45_356.5);
}

#[test]
fn files_that_are_no_text_are_named() {
    let message = not_opened("\"TOB1\",\"St\",\"CR1000\"\n\"SECONDS\",\"T\"\n\u{1}\u{2}\u{3}\n");
    assert!(message.contains("TOA5"), "{message}");
}

fn names(table: &Table) -> Vec<&str> {
    table
        .selected()
        .iter()
        .map(|i| table.columns()[*i].name.as_str())
        .collect()
}

/// Defect: the names of the upper line were left out as a title.
#[test]
fn equal_names_are_told_apart_by_the_line_above() {
    let row = |i: usize| format!("2026-03-01 {i:02}:00,20.{i},{i},5.{i},{i}");
    let rows = (0..12).map(|i| row(i) + "\n").collect::<String>();
    for (above, expected) in [
        (",Kitchen,,Attic,", ["Kitchen T", "Kitchen H", "Attic T", "Attic H"]),
        ("place,Kitchen,Kitchen,Attic,Attic", ["Kitchen T", "Kitchen H", "Attic T", "Attic H"]),
        ("Report,,,,", ["T", "H", "T_2", "H_2"]),
    ] {
        let table = open(&format!("{above}\ntime,T,H,T,H\n{rows}"));
        assert_eq!(names(&table), expected, "{above}");
    }
    let table = open(&format!("sensor,T,T,H,H\nroom,a,b,a,b\ntime,,,,\n{rows}"));
    assert_eq!(names(&table), ["T a", "T b", "H a", "H b"]);
    let table = open(&format!("time,T1,T2,T3,T4\n,,quality,,number\n{rows}"));
    assert_eq!(names(&table), ["T1", "quality", "T3", "number"]);
}

#[test]
fn names_that_say_utc_alone_state_it() {
    for header in ["Datum;Tid (UTC);v", "Datum;time_utc;v", "UTC_DATE;UTC_TIME;v"] {
        let table = open(&lines(header, |i| format!("2026-03-01;{:02}:00:00;{i}.5", i % 20)));
        assert_eq!(table.time().map(|time| time.1), Some(Scale::Utc), "{header}");
    }
    let table = open(&lines("Time (GMT);v", |i| format!("2026-03-01 {i:02}:00:00;{i}.5")));
    assert_eq!(table.time().map(|time| time.1), Some(Scale::Utc));
    let table = open(&lines("Local time (not UTC);v", |i| format!("2026-03-01 {i:02}:00:00;{i}.5")));
    assert_eq!(table.time().map(|time| time.1), Some(Scale::Local));
    let table = open(&lines("outcome;v", |i| format!("2026-03-01 {i:02}:00:00;{i}.5")));
    assert_eq!(table.time().map(|time| time.1), Some(Scale::Local));
}

/// Defect: such columns became words.
#[test]
fn numbers_with_units_are_no_words() {
    let strips = Dialect {
        strip_units: true,
        ..Dialect::default()
    };
    for (cell, first) in [
        ("20,@ °C", 20.0),
        ("0,@ %", 0.0),
        ("20.@C", 20.0),
        ("3.@kWh", 3.0),
        ("0.@k", 0.0),
    ] {
        let text = lines("time;v", |i| format!("{i};{}", cell.replace('@', &(i % 10).to_string())));
        assert!(not_opened(&text).contains("--strip-units"), "{cell}");
        let mut table = open_said(&text, &strips).unwrap();
        table.find_time().unwrap();
        let cells = numbers(&rows(&mut table).columns[0]);
        assert_eq!(cells[..2], [Some(first), Some(first + 0.1)], "{cell}");
    }
    // Words that begin with a digit stay words.
    let table = open(&lines("time,band", |i| format!("{i},{}GHz", [2, 5][i % 2])));
    assert_eq!(table.columns()[1].kind, Kind::Words);
}

#[test]
fn what_is_no_table_of_rows_is_named() {
    let metrics = "# HELP t temperature\n# TYPE t gauge\nt{c=\"a\"} 40 1772323200000\nt{c=\"b\"} 41 1772323200000\n";
    assert!(not_opened(metrics).contains("Prometheus"));
    for text in [
        "{\"a\":1,\"rows\":[{\"t\":1,\"v\":2},{\"t\":2,\"v\":3}]}\n",
        "{\"T\":[{\"ts\":1772323200000,\"value\":\"2\"},{\"ts\":1772323260000,\"value\":\"3\"}]}\n",
    ] {
        assert!(not_opened(text).contains("a list of rows"), "{text}");
    }
    assert!(not_opened("up{job=\"a\"} 1\nup{job=\"b\"} 0\n").contains("Prometheus"));
    for mark in [",", ";", "\t"] {
        let times: Vec<String> = (0..9).map(|i| format!("2026-03-01T{i:02}:00")).collect();
        let values: Vec<String> = (0..9).map(|i| format!("{i}.5")).collect();
        let text = format!("time{mark}{}\ntemp{mark}{}\n", times.join(mark), values.join(mark));
        assert!(not_opened(&text).contains("on its side"), "{mark}");
    }
    assert!(not_opened(&lines("time,v", |i| format!("{i},{}", ['\u{663}', '\u{664}'][i % 2]))).contains("0 to 9"));
    assert!(
        not_opened(&lines("time,v", |i| if i == 3 { "3,<0.5".into() } else { format!("{i},{i}.5") }))
            .contains("below or above")
    );
}

#[test]
fn the_last_day_of_the_calendar_is_a_date() {
    for text in ["9999-12-31T23:59:59", "9999-12-30T22:00:01"] {
        let shown = times(&format!("time,v\n2026-03-01T00:00:00,1\n{text},2\n"));
        assert!(shown[1].ends_with(&text[text.len() - 14..]), "{shown:?}");
    }
}

#[test]
fn single_quotes_around_delimiters_are_quotes() {
    let table = open(&lines("time;'a;b';v", |i| format!("{i};'x;y';{i}")));
    assert_eq!(names(&table), ["a;b", "v"]);
    let table = open(&lines("time,note,v", |i| format!("{i},'tis,it's {i}")));
    assert_eq!(names(&table), ["note", "v"]);
    let mut table = open(&lines("time;v", |i| format!("{i};\u{a0}{i},5\u{a0}")));
    assert_eq!(numbers(&rows(&mut table).columns[0])[1], Some(1.5));
}
