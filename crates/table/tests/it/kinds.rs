//! Numbers, gaps, words, booleans, whole numbers of 64 bits, names.

use super::{numbers, open, open_said, refusal, rows};
use fewbits_table::{Cells, Dialect, Kind, Table};

#[test]
fn usual_spellings_of_gaps() {
    let words =
        "NA N/A n/a null NULL None none nil #N/A #NA <NA> NaT NoData ? - -- --- . * M missing unavailable unknown";
    let mut text = "time,x\n0,1.5\n".to_owned();
    for (i, word) in words.split(' ').enumerate() {
        text += &format!("{},{word}\n{},{i}.25\n", 2 * i + 1, 2 * i + 2);
    }
    let cells = numbers(&rows(&mut open(&text)).columns[0]);
    let gaps = cells.iter().filter(|cell| cell.is_none()).count();
    assert_eq!((gaps, cells.len()), (words.split(' ').count(), 2 * words.split(' ').count() + 1));
    for (word, value) in [
        ("1.#INF", f64::INFINITY),
        ("-1.#INF", f64::NEG_INFINITY),
        ("-inf", f64::NEG_INFINITY),
        ("+inf", f64::INFINITY),
    ] {
        assert_eq!(numbers(&rows(&mut open(&format!("time,x\n0,1\n1,{word}\n"))).columns[0])[1], Some(value));
    }
    for word in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND"] {
        assert!(
            numbers(&rows(&mut open(&format!("time,x\n0,1\n1,{word}\n"))).columns[0])[1]
                .unwrap()
                .is_nan()
        );
    }
    // A word of a fault is a fault until it is named.
    let text = "time,x\n0,1.5\n1,ERR\n2,2.5\n";
    let message = refusal(&mut open(text));
    assert!(message.contains("line 3 (row 2), column `x`: `ERR`") && message.contains("--missing"), "{message}");
    let said = Dialect {
        missing: vec!["ERR".to_owned()],
        ..Dialect::default()
    };
    let mut table = open_said(text, &said).unwrap();
    table.find_time().unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1.5), None, Some(2.5)]);
}

#[test]
fn sentinels_are_gaps_where_they_are_named() {
    let mut text = "time,temp,wind\n".to_owned();
    for i in 0..40 {
        text += &format!(
            "{i},{},{}\n",
            if i == 7 {
                "-9999.00".to_owned()
            } else {
                format!("{}.5", 16 + i % 5)
            },
            i % 3 - 9999 * i64::from(i == 8)
        );
    }
    let survey = |said: &Dialect| {
        let mut table = open_said(&text, said).unwrap();
        table.find_time().unwrap();
        table.survey().unwrap()
    };
    let plain = survey(&Dialect::default());
    let found = plain.columns[1].sentinel().unwrap();
    assert_eq!((found.value, found.count, found.range_without), (-9999.0, 1, (16.5, 20.5)));
    assert_eq!(
        survey(&Dialect {
            missing: vec!["-9999".to_owned()],
            ..Dialect::default()
        })
        .columns[1]
            .range,
        Some((16.5, 20.5))
    );
    // Named for one column: not that of the other.
    let one = survey(&Dialect {
        missing: vec!["temp=-9999".to_owned()],
        ..Dialect::default()
    });
    assert_eq!((one.columns[1].range, one.columns[2].range), (Some((16.5, 20.5)), Some((-9997.0, 2.0))));
    assert!(one.columns[1].sentinel().is_none());
    assert!(
        open_said(
            &text,
            &Dialect {
                missing: vec!["tmp=-9999".to_owned()],
                ..Dialect::default()
            }
        )
        .is_err()
    );
}

#[test]
fn words_booleans_and_whole_numbers() {
    let text = "time,mode,ok,count,note\n0,off,true,9007199254740993,a\n1,heat,False,-3,\n2,,ON,4,b\n3,off,,1152921504606846976,a\n";
    let mut table = open(text);
    let kinds: Vec<Kind> = table.columns().iter().map(|column| column.kind).collect();
    assert_eq!(kinds, [Kind::Number, Kind::Words, Kind::Boolean, Kind::Integer, Kind::Words]);
    let batch = rows(&mut table);
    // Words that the first lines have stand in the order of their letters.
    assert_eq!(table.words(1), ["heat", "off"]);
    assert_eq!(batch.columns[0], Cells::Words(vec![Some(1), Some(0), None, Some(1)]));
    let mut fixed = open(text);
    fixed.fix_words(1, vec!["cool".to_owned(), "off".to_owned()]);
    assert!(refusal(&mut fixed).contains("`heat` is none of the words"));
    assert_eq!(batch.columns[1], Cells::Booleans(vec![Some(true), Some(false), Some(true), None]));
    assert_eq!(
        batch.columns[2],
        Cells::Integers(vec![Some(9_007_199_254_740_993), Some(-3), Some(4), Some(1 << 60)])
    );
    assert_eq!(batch.columns[2].number(3), Ok(Some((1_u64 << 60) as f64)));
    // What is left out cannot refuse the table.
    let mut long = "time,x,id\n".to_owned();
    (0..400).for_each(|i| long += &format!("{i},{i},text-{i}\n"));
    let mut table = open(&long);
    assert!(refusal(&mut table).contains("--without"));
    let mut table = open(&long);
    table.leave_out(&["id"]).unwrap();
    assert_eq!(rows(&mut table).rows, 400);
}

#[test]
fn numbers_that_no_double_holds_are_refused() {
    for cell in [
        "1e400",
        "-1e999",
        "1e-400",
        "9007199254740993.5e0x",
        "36893488147419103233",
    ] {
        let message = refusal(&mut open(&format!("time,x\n0,1.5\n1,{cell}\n2,2.5\n")));
        assert!(message.contains(&format!("line 3 (row 2), column `x`: `{cell}`")), "{message}");
    }
    let message = refusal(&mut open("time,x\n0,1.5\n1,9007199254740993.0\n2,2.5\n"));
    assert!(message.contains("53 bits"), "{message}");
    // Defect: a first row of such numbers was taken for the line of names, and the names were dropped.
    for row in ["1e400", "-1e999", "1e-400", "36893488147419103233"] {
        for columns in [1, 2] {
            let [names, first, second] = ["a", row, "1"].map(|cell| vec![cell; columns].join(","));
            let names = names.replace("a,a", "a,b");
            let mut table = open(&format!("{names}\n{first}\n{second}\n"));
            assert_eq!(table.columns()[0].name, "a");
            let message = refusal(&mut table);
            assert!(message.contains(&format!("line 2 (row 1), column `a`: `{row}`")), "{message}");
        }
    }
}

#[test]
fn numbers_of_another_spelling_are_no_words() {
    for cells in [
        ["1,721", "2,881"],
        ["19.75 °C", "20 °C"],
        ["40%", "41%"],
        ["1'000.5", "2'000.5"],
    ] {
        let mut table = open(&format!("t;x\n0;{}\n1;{}\n", cells[0], cells[1]));
        assert_eq!(table.columns()[1].kind, Kind::Number);
        assert!(refusal(&mut table).contains("line 2 (row 1), column `x`"));
    }
}

#[test]
fn units_and_signs_in_cells() {
    for (cell, word) in [
        ("19.75 °C", "--strip-units"),
        ("40.2%", "--strip-units"),
        ("0x1F", "hexadecimal"),
        ("1,5,0", "--thousands"),
    ] {
        let message = refusal(&mut open(&format!("time;x\n0;1.5\n1;{cell}\n2;2.5\n")));
        assert!(message.contains(word), "{message}");
    }
    let said = Dialect {
        strip_units: true,
        ..Dialect::default()
    };
    let mut table = open_said("time,x\n0,19.75 °C\n1,\u{2212}3.5 °C\n2,+ 0.5 °C\n", &said).unwrap();
    table.find_time().unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(19.75), Some(-3.5), Some(0.5)]);
}

#[test]
fn every_column_has_a_name_of_its_own() {
    let mut table = open("Time,A,\"Temp, °F\",A,,Time\n0,1,2,3,4,5\n1,1,2,3,4,5\n");
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["Time", "A", "Temp, °F", "A_2", "column_5", "Time_2"]);
    table.select(&["A_2", "Temp, °F", "#5"]).unwrap();
    let batch = rows(&mut table);
    assert_eq!(
        batch
            .columns
            .iter()
            .map(|cells| numbers(cells)[0].unwrap())
            .collect::<Vec<_>>(),
        [3.0, 2.0, 4.0]
    );
    let message = table.position("B").unwrap_err().to_string();
    assert!(message.contains("there are Time, A"), "{message}");
    // A long list is cut.
    let wide = format!(
        "{}\n{}\n",
        (0..5000).map(|i| format!("n{i}")).collect::<Vec<_>>().join(","),
        vec!["1"; 5000].join(",")
    );
    let message = Table::open(std::io::Cursor::new(wide), &Dialect::default())
        .unwrap()
        .position("x")
        .unwrap_err()
        .to_string();
    assert!(message.len() < 300 && message.contains("and 4980 more"), "{message}");
}

#[test]
fn zero_and_one_among_booleans_are_booleans() {
    for cells in [
        ["true", "0", "1", "false"],
        ["0", "1", "0", "on"],
        ["1", "yes", "", "no"],
    ] {
        let text = cells
            .iter()
            .fold("n,door\n".to_owned(), |text, cell| text + &format!("1,{cell}\n"));
        let survey = open(&text).survey().unwrap();
        assert_eq!((survey.columns[1].kind(), survey.columns[1].suspicious()), (Kind::Boolean, 0), "{cells:?}");
        let mut table = open(&text);
        table.use_survey(&survey);
        let expected = cells.map(|cell| match cell {
            "true" | "1" | "on" | "yes" => Some(1.0),
            "" => None,
            _ => Some(0.0),
        });
        assert_eq!(numbers(&rows(&mut table).columns[1]), expected, "{cells:?}");
    }
    let text = "n,door\n1,true\n1,2\n1,0\n1,1\n";
    assert_ne!(open(text).survey().unwrap().columns[1].kind(), Kind::Boolean);
}
