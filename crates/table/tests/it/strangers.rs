//! Tables in shapes of more programs: titles, rulers, settings and units around the names, and numbers and times in further spellings.

use super::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Error, Table};

fn lines(header: &str, row: impl Fn(usize) -> String) -> String {
    (0..20).fold(header.to_owned() + "\n", |text, i| text + &row(i) + "\n")
}

/// The times as text, and the numbers of the first column of values.
fn read(mut table: Table) -> (Vec<String>, Vec<Option<f64>>) {
    let (_, scale) = table.time().unwrap();
    let batch = rows(&mut table);
    (batch.times.iter().map(|time| time.shown(scale, 0)).collect(), numbers(&batch.columns[0]))
}

fn names(table: &Table) -> Vec<&str> {
    table.columns().iter().map(|column| column.name.as_str()).collect()
}

#[test]
fn settings_behind_a_line_that_names_the_delimiter() {
    let header =
        "sep=;\nVersion CSV1|Delimiter semicolon\n\n;SN: 21;SN: 21\n;21;21\n;Yield;Power\ndd.MM.yyyy HH:mm:ss;kWh;kW";
    let table = open(&lines(header, |i| format!("25.03.2024 10:{i:02}:00;{i},5;1,25")));
    assert_eq!(names(&table)[1..], ["Yield", "Power"]);
    assert_eq!(table.columns()[2].unit, "kW");
    // The options that are shown read the same.
    let said = table.dialect().clone();
    let again = open_said(&lines(header, |i| format!("25.03.2024 10:{i:02}:00;{i},5;1,25")), &said).unwrap();
    assert_eq!(names(&again), names(&table));
    let (times, values) = read(table);
    assert_eq!((times[1].as_str(), values[1]), ("2024-03-25T10:01:00", Some(1.5)));
    assert_eq!(times.len(), 20);
}

#[test]
fn commas_behind_a_zero_or_many_digits_are_decimal() {
    for (cell, expected) in [
        ("0,125", 0.125),
        ("-0,125", -0.125),
        ("1234,500", 1234.5),
        ("1,25E-03", 0.00125),
    ] {
        let mut table = open(&lines("Zeit;Wert", |i| format!("25.03.2024 10:{i:02};{cell}")));
        assert_eq!(numbers(&rows(&mut table).columns[0])[3], Some(expected), "{cell}");
    }
    // Three digits behind one to three others may be a group.
    let mut table = open(&lines("Zeit;Wert", |i| format!("25.03.2024 10:{i:02};1,125")));
    assert!(refusal(&mut table).contains("--thousands ,"));
    let mut table = open(&lines("Zeit (s);Wert", |i| format!("{i},500000000E-01;1,5")));
    table.find_time().unwrap();
    assert_eq!(seconds(&rows(&mut table))[2], 0.25);
}

#[test]
fn weeks_are_those_of_their_mondays() {
    let (times, _) = read(open(&lines("week,v", |i| format!("2024-W{:02},{i}", i + 1))));
    assert_eq!(times[..2], ["2024-01-01T00:00:00", "2024-01-08T00:00:00"]);
}

#[test]
fn rulers_below_names_are_no_names() {
    for (names, ruler, mark) in [
        ("  ts                  |  temp ", "----------------------+-------", " | "),
        ("| ts | temp |", "|----|------|", " | "),
        ("ts\ttemp", "--\t----", "\t"),
        ("ts,temp", "==,====", ","),
    ] {
        let around = if names.starts_with("| ") { "|" } else { "" };
        let text =
            lines(&format!("{names}\n{ruler}"), |i| format!("{around} 2024-03-25 10:{i:02}:00{mark}{i}.5 {around}"));
        let mut table = open(&text);
        assert!(table.find_time().unwrap(), "{ruler}");
        let found = rows(&mut table);
        assert_eq!((found.rows, found.times.len()), (20, 20), "{ruler}");
        assert!(table.columns().iter().any(|column| column.name == "temp"), "{ruler}");
    }
}

#[test]
fn titles_above_aligned_columns() {
    let header = "procs -------memory------ --swap--\n r  b   free   buff  cache   si";
    let mut table = open(&lines(header, |i| format!(" 1  0  {:5}  12000 345678    0", 1000 + i)));
    assert_eq!(names(&table), ["r", "b", "free", "buff", "cache", "si"]);
    assert_eq!(numbers(&rows(&mut table).columns[2])[1], Some(1001.0));
}

#[test]
fn names_and_units_of_instruments() {
    // The units of an oscilloscope's names are no row, and its rows are shorter.
    let mut table = open(&lines("X,CH1,Start,Increment,\nSequence,Volt,-6.0e-03,1.0e-05", |i| format!("{i},{i}.5,")));
    assert_eq!(names(&table), ["X", "CH1", "Start", "Increment"]);
    assert_eq!(rows(&mut table).rows, 20);
    // A word for the kind of the row stands before units.
    let header = "DATAH\tSeconds\tCO2\tH2O\nDATAU\tsecs\tmmol\tmmol";
    let table = open(&lines(header, |i| format!("DATA\t{i}\t1.5\t2.5")));
    assert_eq!(names(&table), ["DATAH", "Seconds", "CO2", "H2O"]);
    assert_eq!(table.columns()[2].unit, "mmol");
}

#[test]
fn dates_in_columns_of_their_own() {
    let said = |columns: &[&str]| Dialect {
        delimiter: Some("spaces".to_owned()),
        no_header: Some(true),
        time_column: columns.iter().map(|name| (*name).to_owned()).collect(),
        ..Dialect::default()
    };
    let read_said = |text: &str, columns: &[&str]| -> Result<Vec<String>, Error> {
        let mut table = open_said(text, &said(columns))?;
        table.set_time(columns)?;
        Ok(read(table).0)
    };
    // Years of two digits, with a time of day.
    let text = lines("98  3  5  0 30  1.5", |i| format!("{:02}  3  5 {:2} 30  1.5", [98, 24][i % 2], i));
    let times = read_said(&text, &["#1", "#2", "#3", "#4", "#5"]).unwrap();
    assert_eq!(times[1..3], ["1998-03-05T00:30:00", "2024-03-05T01:30:00"]);
    let named = lines("yy mm dd hh v", |i| format!("98 03 05 {i:02} 1"));
    assert_eq!(read(open(&named)).0[2], "1998-03-05T02:00:00");
    // A year and a month; of few rows they may be days of the year.
    let monthly = |rows: usize| -> String {
        (0..rows)
            .map(|i| format!("{} {} 1.5\n", 1958 + i / 12, i % 12 + 1))
            .collect()
    };
    assert_eq!(
        read_said(&monthly(30), &["#1", "#2"]).unwrap()[12..14],
        ["1959-01-01T00:00:00", "1959-02-01T00:00:00"]
    );
    assert!(
        read_said(&monthly(6), &["#1", "#2"])
            .unwrap_err()
            .to_string()
            .contains("is not a time")
    );
    let daily: String = (0..30).map(|i| format!("1958 {} 1.5\n", i + 1)).collect();
    assert_eq!(read_said(&daily, &["#1", "#2"]).unwrap()[12], "1958-01-13T00:00:00");
}

#[test]
fn julian_dates_are_asked_for() {
    for (name, first, format) in [
        ("JD", 2_460_375.5, "jd"),
        ("MJD", 60_375.0, "mjd"),
        ("BJD_TDB", 2_460_375.5, "jd"),
    ] {
        let text = lines(&format!("{name},mag"), |i| format!("{},1.5", first + i as f64));
        let mut table = open_said(&text, &Dialect::default()).unwrap();
        let message = table.set_time(&[name]).unwrap_err().to_string();
        assert!(message.contains("Julian date") && message.contains("--time-format jd"), "{message}");
        let said = Dialect {
            time_format: Some(format.to_owned()),
            ..Dialect::default()
        };
        let mut table = open_said(&text, &said).unwrap();
        table.set_time(&[name]).unwrap();
        assert!(read(table).0[1].starts_with("2024-03-0"), "{name}");
    }
}

#[test]
fn settings_with_numbers_above_the_names() {
    // Places above a forecast, in more columns than the rows have.
    let header = "latitude,longitude,elevation,zone\n52.52,13.4,38.0,GMT\n\ntime,temperature (°C)";
    let (times, values) = read(open(&lines(header, |i| format!("2024-03-05T{i:02}:00,{i}.5"))));
    assert_eq!((times.len(), times[0].as_str(), values[1]), (20, "2024-03-05T00:00:00", Some(1.5)));
    // Names between a title of more words and a short line of units.
    let header = "Oxford\nLocation: 450900E 207200N\nMarked with a * after the value of a month.\n  yyyy  mm  tmax  rain\n            degC    mm";
    let table = open(&lines(header, |i| format!("  {}  {:2}  {i}.5  2.0", 1853 + i / 12, i % 12 + 1)));
    assert_eq!(names(&table), ["yyyy", "mm", "tmax", "rain"]);
    let (times, values) = read(table);
    assert_eq!((times[13].as_str(), values[0]), ("1854-02-01T00:00:00", Some(0.5)));
}

#[test]
fn times_of_day_and_zones_of_further_programs() {
    for (cell, expected) in [
        ("05-Mar-24 21.30.05", "2024-03-05T21:30:05"),
        ("05-MAR-24 09.30.05.250000 PM", "2024-03-05T21:30:05"),
        ("2024-03-05 21.30.05", "2024-03-05T21:30:05"),
        ("2024-03-05_21-30-05", "2024-03-05T21:30:05"),
        ("2024-03-05 21:30:05.25 +0000 UTC", "2024-03-05T21:30:05Z"),
        ("2024-03-05 22:30:05 +0100 CET", "2024-03-05T21:30:05Z"),
        ("Tue Mar 05 2024 22:30:05 GMT+0100 (Central European Standard Time)", "2024-03-05T21:30:05Z"),
    ] {
        assert_eq!(read(open(&format!("time,x\n{cell},1\n"))).0, [expected], "{cell}");
    }
    let text = lines("Data;Hora UTC;T", |i| format!("2024/03/05;{i:02}30 UTC;{i},5"));
    assert_eq!(read(open(&text)).0[1], "2024-03-05T01:30:00Z");
}

#[test]
fn nulls_of_databases_are_gaps_and_signs_of_currencies_are_told() {
    let mut table = open("time,x\n0,1.5\n1,\\N\n2,2.5\n");
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1.5), None, Some(2.5)]);
    let mut table = open(&lines("time,x", |i| format!("{i},${i}.25")));
    let message = refusal(&mut table);
    assert!(message.contains("`$0.25` is not a number: a sign in front"), "{message}");
}

#[test]
fn names_state_the_offset_of_their_times() {
    for name in [
        "Date Time - GMT +05:00",
        "Date Time, GMT+05:00",
        "time (UTC+5)",
        "time (UTC +05:00)",
    ] {
        let text = lines(&format!("\"{name}\",x"), |i| format!("2018-05-03 08:{i:02}:23,1"));
        assert_eq!(read(open(&text)).0[0], "2018-05-03T03:00:23Z", "{name}");
    }
}
