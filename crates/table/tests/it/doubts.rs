//! Numbers that may count something else than seconds, and cells that would be read as something else: refused with the option that decides.

use super::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Table};

/// The refusal of a table when it is opened, its time is looked for, or it is read.
fn refused(text: &str) -> String {
    let table = open_said(text, &Dialect::default()).and_then(|mut table| table.require_time().map(|()| table));
    match table {
        Ok(mut table) => refusal(&mut table),
        Err(error) => error.to_string(),
    }
}

/// Lines of a time with so many decimals, and a count.
fn timed(name: &str, decimals: usize, time: impl Fn(f64) -> f64) -> String {
    let row = |i: u32| format!("{:.decimals$},{i}\n", time(f64::from(i)));
    (0..60).fold(format!("{name},x\n"), |text, i| text + &row(i))
}

fn mend(text: &str, option: &str) {
    let message = refused(text);
    assert!(message.contains("line 2 (row 1)") && message.contains(option), "{option}: {message}");
}

#[test]
fn parts_of_a_day_are_no_seconds() {
    for (decimals, per_day, from) in [
        (5, 1440.0, 0.0),
        (10, 1440.0, 0.25),
        (15, 86_400.0, 0.9),
        (8, 288.0, 0.1),
    ] {
        let text = timed("time", decimals, |i| from + i / per_day);
        mend(&text, "--time-format d");
    }
    // A day of hours, and the next one.
    mend(&timed("Time", 6, |i| (i % 24.0) / 24.0), "--time-format d");
    let said = Dialect {
        time_format: Some("d".to_owned()),
        ..Dialect::default()
    };
    let mut table = open_said(&timed("time", 10, |i| i / 1440.0), &said).unwrap();
    table.find_time().unwrap();
    let found = seconds(&rows(&mut table));
    assert!(
        found
            .iter()
            .zip(0..)
            .all(|(s, i)| (s - 60.0 * f64::from(i)).abs() < 1e-5),
        "{found:?}"
    );
}

#[test]
fn seconds_of_usual_rates_stay_seconds() {
    for (rate, decimals) in [
        (24.0, 6),
        (30.0, 4),
        (60.0, 6),
        (80.0, 4),
        (100.0, 2),
        (1000.0, 3),
        (44_100.0, 9),
        (7.0, 5),
    ] {
        let text = timed("time", decimals, |i| i / rate);
        let found = seconds(&rows(&mut open(&text)));
        assert!((found[59] - 59.0 / rate).abs() < 1e-3, "{rate}: {}", found[59]);
    }
}

#[test]
fn years_with_decimals_and_days_since_the_year_0_are_no_seconds() {
    mend(&timed("decimal year", 3, |i| 1958.0 + (i + 0.5) / 12.0), "year with decimals");
    mend(&timed("year", 1, |i| 1958.0 + i / 2.0), "year with decimals");
    mend(&timed("time", 4, |i| 1958.0 + i / 12.0), "year with decimals");
    mend(&timed("time", 4, |i| 2024.0 + (i + 0.5) / 366.0), "year with decimals");
    mend(&timed("t", 8, |i| 739_252.0 + i / 24.0), "--time-format matlab");
    // Seconds of that size.
    let found = seconds(&rows(&mut open(&timed("time", 2, |i| 2000.0 + 0.37 * i))));
    assert!((found[1] - 2000.37).abs() < 1e-9);
}

#[test]
fn date_that_rows_share_is_not_alone() {
    let line = |i: usize| format!("20240305,{},{i}\n", 5 * (i % 12) + 100 * (i / 12));
    let text = (0..40).fold("UTC_DATE,UTC_TIME,x\n".to_owned(), |text, i| text + &line(i));
    mend(&text, "--time-column UTC_DATE,UTC_TIME, or --time-column UTC_DATE");
    let said = Dialect {
        time_column: vec!["UTC_DATE".to_owned(), "UTC_TIME".to_owned()],
        ..Dialect::default()
    };
    let found = seconds(&rows(&mut open_said(&text, &said).unwrap()));
    assert_eq!(found[13] - found[0], 3900.0);
    // Several places a day share dates, too.
    let places =
        (0..40).fold("date,place,x\n".to_owned(), |text, i| text + &format!("2024-03-{:02},{},1\n", 1 + i / 4, i % 4));
    assert_eq!(rows(&mut open(&places)).rows, 40);
}

#[test]
fn days_of_years_need_no_month() {
    let text =
        (0..40).fold("Year,Day,Hour,x\n".to_owned(), |text, h| text + &format!("2024,{},{},1\n", 31 + h / 24, h % 24));
    let mut table = open(&text);
    let (_, scale) = table.time().unwrap();
    assert_eq!(rows(&mut table).times[39].shown(scale, 0), "2024-02-01T15:00:00");
}

#[test]
fn interval_is_its_beginning() {
    for interval in [
        "05.03.2024 09:00 - 05.03.2024 10:00",
        "05/03/2024 09:00 \u{2013} 05/03/2024 10:00",
        "2024-03-05T09:00Z/2024-03-05T10:00Z",
        "2024-03-05 09:00 - 2024-03-05 10:00",
    ] {
        let text = format!("MTU,load\n13.03.2024 09:00 - 13.03.2024 10:00,1\n{interval},2\n");
        let text = match interval.starts_with("05") {
            true => text.replace("13.03.2024", &interval[..10].replacen("05", "13", 1)),
            false => format!("MTU,load\n{interval},1\n{interval},2\n"),
        };
        let mut table = open(&text);
        let (_, scale) = table.time().unwrap();
        let shown = rows(&mut table).times[1].shown(scale, 0);
        assert_eq!(shown.trim_end_matches('Z'), "2024-03-05T09:00:00", "{interval}");
    }
    // What ends before it begins is none.
    assert!(refused("time,x\n2024-03-05 09:00 - 2024-03-04 09:00,1\n").contains("is not"));
}

#[test]
fn magnetic_observatory() {
    let mut text = format!(" {:<23}{:<45}|\n", "Format", "IAGA-2002");
    text += &format!(" {:<23}{:<45}|\n # {:<66}|\n", "Station Name", "Niemegk", "provisional, 1 min");
    text += "DATE       TIME         DOY     NGKX      NGKY   |\n";
    let row =
        |i: u32| format!("2024-03-05 00:{i:02}:00.000 065     {:9.2} {:9.2}\n", 18_000.25 + f64::from(i), 99_999.0);
    text = (0..20).fold(text, |text, i| text + &row(i));
    let mut table = open(&text);
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["DATE", "TIME", "DOY", "NGKX", "NGKY"]);
    let batch = rows(&mut table);
    assert_eq!((batch.rows, numbers(&batch.columns[1])[19]), (20, Some(18_019.25)));
    assert!(numbers(&batch.columns[2]).iter().all(Option::is_none));
    let (_, scale) = table.time().unwrap();
    assert_eq!(batch.times[19].shown(scale, 0), "2024-03-05T00:19:00");
}

#[test]
fn one_mark_is_not_of_groups_and_decimals() {
    for (mark, cells) in [('.', "1.000;2.500"), (',', "1,000;2,500")] {
        let said = Dialect {
            thousands: Some(mark),
            ..Dialect::default()
        };
        let (a, b) = cells.split_once(';').unwrap();
        let mut table = open_said(&format!("x;y\n1;{a}\n2;{b}\n"), &said).unwrap();
        assert_eq!(numbers(&rows(&mut table).columns[1]), [Some(1000.0), Some(2500.0)], "{mark}");
    }
}

#[test]
fn cells_with_nul_are_no_words() {
    let text = (0..30).fold("time,x\n".to_owned(), |text, i| text + &format!("{i},{i}.5\0\n"));
    mend(&text, "NUL bytes, as after a loss of power: leave such lines out with --skip-bad");
}

#[test]
fn all_columns_of_texts_are_named_at_once() {
    let row = |i: u32| format!("{i},\"-0{i:03},1\",2,\"0{i:03},1\",low {i}.5\n");
    let text = (0..30).fold("time,TMP,x,DEW,state\n".to_owned(), |text, i| text + &row(i));
    let message = refused(&text);
    assert!(message.contains("several parts") && message.contains("--without TMP,DEW"), "{message}");
    // A byte of a counter is no current in ampere.
    let hexadecimal = (0..30).fold("time,x\n".to_owned(), |text, i| text + &format!("{i},{i:02X}\n"));
    assert!(refused(&hexadecimal).contains("hexadecimal numbers are not read"));
}

#[test]
fn marks_of_an_encoding_may_be_repeated() {
    let table: Table = open("\u{feff}\u{feff}time,x\n1,2\n\u{feff}\u{feff}time,x\n2,3\n");
    assert_eq!(table.columns()[0].name, "time");
    let mut table = table;
    assert_eq!(rows(&mut table).rows, 2);
}

#[test]
fn groups_of_digits_in_times_are_no_decimals() {
    let text = "t,x\n999,5\n\"1,000\",6\n\"1,001\",7\n";
    let message = refused(text);
    assert!(
        message.contains("line 3 (row 2), column `t`: `1,000`") && message.contains("--thousands ,"),
        "{message}"
    );
    let grouped = |mark: char, text: &str| {
        let said = Dialect {
            thousands: Some(mark),
            ..Dialect::default()
        };
        let mut table = open_said(text, &said).unwrap();
        table.require_time().unwrap();
        seconds(&rows(&mut table))
    };
    assert_eq!(grouped(',', text), [999.0, 1000.0, 1001.0]);
    assert_eq!(grouped('.', "t;x\n999;5\n1.000;6\n1.001,5;7\n"), [999.0, 1000.0, 1001.5]);
    assert_eq!(grouped(',', "t,x\n\"1,721,992,142.283\",5\n"), [1_721_992_142.283]);
    // In a table of decimal commas, times have them.
    assert_eq!(seconds(&rows(&mut open("t;x\n0,5;5,25\n1,5;6,25\n"))), [0.5, 1.5]);
}

#[test]
fn digits_without_marks_are_no_counts() {
    let of = |name: &str, time: &dyn Fn(u32) -> u32| {
        (0..90).fold(format!("{name},x\n"), |text, i| text + &format!("{},1\n", time(i)))
    };
    mend(&of("time", &|i| i / 60 * 100 + i % 60), "time of day whose digits have no marks");
    mend(&of("time", &|i| (i % 24) * 100), "time of day whose digits have no marks");
    mend(&of("time", &|i| 93_000 + i / 60 * 100 + i % 60), "time of day whose digits have no marks");
    mend(&of("month", &|i| 202_001 + i / 12 * 100 + i % 12), "--time-format %Y%m");
    mend(&of("year", &|i| 1990 + i), "--time-format %Y");
    mend(&timed("Time (min.sec)", 2, |i| i / 100.0), "--time-format %M.%S");
    // What the refusals say is read.
    for (format, first, second, name) in [
        ("%Y", "1990", "1991", "1991-01-01"),
        ("%Y%m", "202001", "202002", "2020-02-01"),
    ] {
        let said = Dialect {
            time_format: Some(format.to_owned()),
            ..Dialect::default()
        };
        let mut table = open_said(&format!("year,x\n{first},1\n{second},2\n"), &said).unwrap();
        table.require_time().unwrap();
        let (_, scale) = table.time().unwrap();
        assert_eq!(rows(&mut table).times[1].shown(scale, 0), format!("{name}T00:00:00"));
    }
    // Counts with the same digits.
    for step in [1, 7, 40, 100] {
        let found = seconds(&rows(&mut open(&of("time", &|i| step * i))));
        assert_eq!(found[89], f64::from(89 * step));
    }
}

#[test]
fn seconds_among_milliseconds_are_refused() {
    let row = |i: u64| {
        format!(
            "{},1\n",
            if i < 20 {
                1_700_000_000 + i
            } else {
                1_700_000_020_000 + i
            }
        )
    };
    mend(&(0..30).fold("time,x\n".to_owned(), |text, i| text + &row(i)), "--time-format, as ms");
    // Behind the first rows, which decide.
    let row = |i: u64| {
        format!(
            "{},1\n",
            if i < 4000 {
                1_700_000_000 + i
            } else {
                1_700_000_020_000 + i
            }
        )
    };
    let message = refused(&(0..4001).fold("time,x\n".to_owned(), |text, i| text + &row(i)));
    assert!(message.contains("line 4002 (row 4001)") && message.contains("of another unit"), "{message}");
    // A clock that was not set yet.
    let row = |i: u64| format!("{},1\n", if i < 20 { 1000 * i } else { 1_700_000_020_000 + 1000 * i });
    let found = seconds(&rows(&mut open(&(0..30).fold("time,x\n".to_owned(), |text, i| text + &row(i)))));
    assert_eq!((found[19], found[20]), (19.0, 1_700_000_040.0));
}

#[test]
fn names_without_an_end_are_no_empty_file() {
    let names: Vec<String> = (0..100_000).map(|i| format!("c{i}")).collect();
    let message = refused(&(names.join(",") + "\n"));
    assert!(message.contains("no end of a line") && message.contains("cut -d,"), "{message}");
}

#[test]
fn names_of_julian_dates_years_and_months_are_asked_for() {
    let rows = |name: &str, cell: &dyn Fn(u32) -> String| {
        (0..12).fold(format!("{name},x\n"), |text, i| text + &format!("{},{i}\n", cell(i)))
    };
    // Whatever the dates count from.
    for (name, zero) in [
        ("TJD", 20_374.5),
        ("HJD-2450000", 10_374.5),
        ("jd", 10_374.5),
        ("Time [BJD - 2454833]", 137.5),
    ] {
        mend(&rows(name, &|i| format!("{}", zero + f64::from(i) / 4.0)), "--time-format jd (or mjd), d for days");
    }
    mend(&rows("date", &|i| format!("{}", 1950 + i)), "--time-format %Y");
    // Months of one year are as far apart as numbers.
    for name in ["month", "Period", "yyyymm"] {
        mend(&rows(name, &|i| format!("2024{:02}", i + 1)), "--time-format %Y%m");
    }
    let seconds_of = |name: &str, from: u32| seconds(&rows_of(name, from));
    assert_eq!(seconds_of("time", 1950)[..2], [1950.0, 1951.0]);
    assert_eq!(seconds_of("time", 202_401)[..2], [202_401.0, 202_402.0]);
}

fn rows_of(name: &str, from: u32) -> fewbits_table::Batch {
    rows(&mut open(&(0..12).fold(format!("{name},x\n"), |text, i| text + &format!("{},{i}\n", from + i))))
}
