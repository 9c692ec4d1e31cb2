//! Texts that come again and again, units that stand for names, and dates that the first rows leave open.

use super::{open, open_said, seconds};
use fewbits_table::{Dialect, Kind, Scale};
use std::collections::BTreeMap;

/// Numbers without a pattern.
fn draws(seed: u64) -> impl FnMut(usize) -> usize {
    let mut state = seed;
    move |below| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    }
}

#[test]
fn texts_are_counted_as_often_as_they_come() {
    let words = [
        "idle",
        "heat 2",
        "ünder",
        "off",
        "on",
        "n/a",
        "---",
        "unavailable",
        "7",
        "7.50",
        "-1",
        "",
        "12 %",
    ];
    for (seed, end) in [(1, "\n"), (2, "\r\n"), (3, "\n")] {
        let mut draw = draws(seed);
        let mut text = format!("n,word{end}");
        let mut counts = BTreeMap::<&str, u64>::new();
        for i in 0..5000 {
            let word = words[draw(words.len())];
            *counts.entry(word).or_default() += 1;
            text += &format!("{i},{word}{end}");
        }
        let said = Dialect {
            missing: vec!["word=idle".to_owned()],
            ..Dialect::default()
        };
        let survey = open_said(&text, &said).unwrap().survey().unwrap();
        let found = &survey.columns[1];
        for gap in ["idle", "n/a", "---", "unavailable", ""] {
            assert_eq!(found.missing.get(gap), counts.get(gap), "{gap}");
        }
        for word in ["heat 2", "ünder", "off", "on", "7", "12 %"] {
            assert_eq!(found.words.get(word), counts.get(word), "{word}");
        }
        let numbers: u64 = ["7", "7.50", "-1"].iter().map(|word| counts[word]).sum();
        assert_eq!((found.numbers, found.gaps() + found.values()), (numbers, 5000));
        assert_eq!(found.kind(), Kind::Words);
    }
}

#[test]
fn different_texts_are_as_many_as_they_are() {
    let text =
        (0..3000).fold("n,id\n".to_owned(), |text, i| text + &format!("{i},part-{:04x} of {}\n", i % 1500, i % 3));
    let survey = open(&text).survey().unwrap();
    assert_eq!((survey.columns[1].kind(), survey.columns[1].values()), (Kind::Text, 3000));
}

#[test]
fn words_have_the_places_of_their_list() {
    let mut draw = draws(7);
    let drawn: Vec<usize> = (0..4000).map(|_| draw(200)).collect();
    let text = drawn
        .iter()
        .fold("w\n".to_owned(), |text, i| text + &format!("valve {i}\n"));
    let mut table = open(&text);
    let batch = super::rows(&mut table);
    for (row, i) in drawn.iter().enumerate() {
        let place = batch.columns[0].number(row).unwrap().unwrap() as usize;
        assert_eq!(table.words(0)[place], format!("valve {i}"));
    }
}

#[test]
fn numbers_among_booleans_are_words_if_few_and_faults_if_many() {
    let rows = |count: usize, different: usize| {
        (0..count).fold("n,door\n".to_owned(), |text, i| {
            let cell = match i % 3 {
                0 => (i % (3 * different)).to_string(),
                1 => "true".to_owned(),
                _ => "false".to_owned(),
            };
            text + &format!("{i},{cell}\n")
        })
    };
    let many = open(&rows(3000, 900)).survey().unwrap();
    assert_eq!((many.columns[1].kind(), many.columns[1].suspicious()), (Kind::Boolean, 1000));
    let text = rows(300, 4);
    let few = open(&text).survey().unwrap();
    assert_eq!((few.columns[1].kind(), few.columns[1].suspicious()), (Kind::Words, 0));
    // All of them are in the list before the first row is read.
    let mut table = open(&text);
    table.use_survey(&few);
    assert_eq!(table.words(1), ["0", "3", "6", "9", "false", "true"]);
}

#[test]
fn a_first_column_with_a_unit_of_time_is_the_time() {
    let rows = "-0.002,0.1\n-0.001,0.2\n0,0.3\n0.001,0.1\n";
    for (names, from) in [
        ("Source [Second],CH1 [Volt]", -0.002),
        ("Source,CH1\nSecond,Volt", -0.002),
        ("X,Y\ns,V", -0.002),
        ("Abscissa (ms),Voltage (V)", -0.000_002),
        ("axis[us],ch0", -0.000_000_002),
        ("Milliseconds,ch0", -0.000_002),
        ("x (h),ch0", -7.2),
    ] {
        let mut table =
            super::Table::open(std::io::Cursor::new(format!("{names}\n{rows}")), &Dialect::default()).unwrap();
        assert!(table.find_certain_time().unwrap(), "{names}");
        let batch = super::rows(&mut table);
        assert_eq!((table.time().unwrap().1, batch.rows), (Scale::Seconds, 4), "{names}");
        assert_eq!(seconds(&batch)[0], from, "{names}");
    }
    // Numbers that do not increase, several columns with such units, and names that may mean anything.
    for text in [
        "Delay [s],x\n3,1\n1,2\n2,3\n",
        "Start [s],Stop [s],x\n1,2,3\n2,3,4\n3,4,5\n",
        "h,x\n1,2\n2,3\n3,4\n",
        "min,max\n1,2\n2,3\n3,4\n",
        "x [m],y\n1,2\n2,3\n3,4\n",
    ] {
        let mut table = super::Table::open(std::io::Cursor::new(text.to_owned()), &Dialect::default()).unwrap();
        assert!(!table.find_certain_time().unwrap(), "{text}");
    }
}

#[test]
fn days_that_may_be_months_are_an_error_of_their_own() {
    let mut table = open_said("date,x\n01/02/2024 10:00,1\n02/02/2024 10:00,2\n", &Dialect::default()).unwrap();
    let error = table.find_time().unwrap_err();
    assert!(error.is_day_or_month() && error.place().is_some());
    let text = error.to_string();
    assert!(text.contains("`01/02/2024 10:00`") && text.contains("--time-format dmy"), "{text}");
    // A year that may stand first or last is another.
    let mut table = open_said("date,x\n01/02/03,1\n01/02/04,2\n", &Dialect::default()).unwrap();
    assert!(!table.find_time().unwrap_err().is_day_or_month());
    // Dates with the day first decide wherever they stand, in the quick spellings too.
    for (row, order) in [("13/02/2024 10:00", "dmy"), ("02/13/2024 9:42 PM", "mdy")] {
        let text = (0..200).fold("date,x\n".to_owned(), |text, i| text + &format!("01/02/2024 10:00,{i}\n"));
        let mut table = open_said(&(text + row + ",1\n"), &Dialect::default()).unwrap();
        table.select::<&str>(&[]).unwrap();
        assert_eq!(table.survey().unwrap().columns[0].day_order(), Some(order));
    }
}

#[test]
fn groups_of_spreadsheets_and_times_without_marks() {
    // A decimal comma behind groups with thin spaces, and no other column to tell.
    for space in ['\u{202f}', '\u{a0}', '\u{2009}', ' '] {
        let text = (0..6).fold("Jour;Énergie\n".to_owned(), |text, i| text + &format!("{};1{space}23{i},7\n", 13 + i));
        let said = Dialect {
            thousands: Some(' '),
            ..Dialect::default()
        };
        let survey = open_said(&text, &said).unwrap().survey().unwrap();
        assert_eq!(survey.columns[1].range, Some((1230.7, 1235.7)), "{space:?}");
    }
    let text = "day,energy\n1,\"1,23,456.5\"\n2,\"99,999\"\n3,\"1,00,00,000\"\n";
    let said = Dialect {
        thousands: Some(','),
        ..Dialect::default()
    };
    let survey = open_said(text, &said).unwrap().survey().unwrap();
    assert_eq!(survey.columns[1].range, Some((99_999.0, 10_000_000.0)));
    // Times of day of a receiver, by their name and size; else they are numbers.
    for (name, expected) in [
        ("utc", [36_059.5, 36_060.0, 86_399.0]),
        ("UTC_Time", [36_059.5, 36_060.0, 86_399.0]),
        ("seconds", [100_059.5, 100_100.0, 235_959.0]),
    ] {
        let mut table = open(&format!("{name},lat\n100059.50,1\n100100.00,2\n235959,3\n"));
        assert_eq!(seconds(&super::rows(&mut table)), expected, "{name}");
    }
    let mut table = open("utc,lat\n100059.5,1\n100061.5,2\n100079.5,3\n");
    assert_eq!(seconds(&super::rows(&mut table)), [100_059.5, 100_061.5, 100_079.5]);
}

#[test]
fn times_with_a_unit_behind_each() {
    for (cells, expected) in [
        (["0 sec", "1.5 sec", "59.25 sec"], [0.0, 1.5, 59.25]),
        (["-2 min", "0 min", "0.5 min"], [-120.0, 0.0, 30.0]),
        (["500ms", "1 s", "1h"], [0.5, 1.0, 3600.0]),
        (["-1 days", "0.5 days", "3 hr"], [-86_400.0, 43_200.0, 10_800.0]),
    ] {
        let text = cells
            .iter()
            .fold("Time,Var1\n".to_owned(), |text, cell| text + cell + ",1.5\n");
        let mut table = open(&text);
        assert_eq!(seconds(&super::rows(&mut table)), expected, "{text}");
    }
    // A value with such a unit is no time, and a cell without one is none among these.
    assert_eq!(open("t,lag\n0,5 s\n1,6 s\n2,7 s\n").columns()[1].kind, Kind::Number);
    let text = "Time,x\n0 sec,1\n1 sec,2\n2 sec,3\n3 apples,4\n4 sec,5\n";
    let mut table = open_said(text, &Dialect::default()).unwrap();
    assert!(table.set_time(&["Time"]).is_err());
}
