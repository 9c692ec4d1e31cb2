//! Further spellings of dates, and times in several columns, against seconds since 1970 that were computed elsewhere (GNU date).

use super::{open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Scale, Table};

const AT: f64 = 1_709_674_200.0; // 2024-03-05T21:30:00Z

fn column(name: &str, cells: &[&str]) -> String {
    let rows: String = cells.iter().map(|cell| format!("{cell};1\n")).collect();
    format!("{name};x\n{rows}")
}

fn read(table: &mut Table) -> (Scale, Vec<f64>) {
    let scale = table.time().unwrap().1;
    (scale, seconds(&rows(table)))
}

fn said(format: Option<&str>, zone: Option<&str>) -> Dialect {
    Dialect {
        time_format: format.map(str::to_owned),
        time_zone: zone.map(str::to_owned),
        time_column: vec!["when".to_owned()],
        ..Dialect::default()
    }
}

#[test]
fn dates_without_marks_with_words_and_by_days_of_the_year() {
    use Scale::{Local, Seconds, Utc};
    for (cells, scale, expected) in [
        (&["20240305T213000Z", "20240305T213001Z"][..], Utc, &[AT, AT + 1.0][..]),
        (&["20240305T213000"], Local, &[AT]),
        (&["20240305213000", "20240305213000.25"], Local, &[AT, AT + 0.25]),
        (&["202403052130"], Local, &[AT]),
        (&["2024030521", "2024030522"], Local, &[AT - 1800.0, AT + 1800.0]),
        (&["20240305213000123"], Local, &[AT + 0.123]),
        (&["20240305", "20240306"], Local, &[AT - 77_400.0, AT + 9000.0]),
        (&["20240305 21:30:00"], Local, &[AT]),
        (&["2024-065T21:30:00"], Local, &[AT]),
        (&["2024-02", "2024-03"], Local, &[1_706_745_600.0, 1_709_251_200.0]),
        (&["Tue, 05 Mar 2024 21:30:00 +0000"], Utc, &[AT]),
        (&["Tue, 05 Mar 2024 21:30:00 GMT"], Utc, &[AT]),
        (&["Tue, 5 Mar 2024 14:30:00 -0700"], Utc, &[AT]),
        (&["Tue Mar  5 21:30:00 2024"], Local, &[AT]),
        (&["Tue Mar  5 21:30:00 UTC 2024"], Utc, &[AT]),
        (&["Mar 05, 2024 09:30:00 PM"], Local, &[AT]),
        (&["March 5th, 2024, 21:30"], Local, &[AT]),
        (&["Tuesday, 5 March 2024 21:30"], Local, &[AT]),
        (&["05MAR2024:21:30:00"], Local, &[AT]),
        (&["05/Mar/2024:21:30:00 +0000"], Utc, &[AT]),
        (&["2024-03-05T22:30:00+01:00[Europe/Berlin]"], Utc, &[AT]),
        (&["2024-03-05 23:30:00 UTC+02:00"], Utc, &[AT]),
        (&["2024-03-05 21:30:00:250"], Local, &[AT + 0.25]),
        (&["2024-03-05 21:30:00."], Local, &[AT]),
        (&["2024-03-05 21"], Local, &[AT - 1800.0]),
        (&["5.3.2024 9:30p", "6.3.2024 12:00a"], Local, &[AT, AT + 9000.0]),
        (&["0 days 00:00:01", "2 days 03:00:00"], Seconds, &[1.0, 183_600.0]),
        (&["0:30.5", "61:00.0"], Seconds, &[30.5, 3660.0]),
    ] {
        let text = column("when", cells);
        let mut table = open_said(&text, &Dialect::default()).unwrap();
        table
            .set_time(&["when"])
            .unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(read(&mut table), (scale, expected.to_vec()), "{text}");
    }
}

#[test]
fn numbers_of_days_are_said() {
    for (format, cell, scale) in [
        ("excel", "45356.895833333333333", Scale::Local),
        ("matlab", "739316.895833333333333", Scale::Local),
        ("mjd", "60374.895833333333333", Scale::Utc),
        ("jd", "2460375.395833333333333", Scale::Utc),
        ("labview", "3792519000", Scale::Utc),
    ] {
        let mut table = open_said(&column("when", &[cell]), &said(Some(format), None)).unwrap();
        let (found, times) = read(&mut table);
        assert!(found == scale && (times[0] - AT).abs() < 1e-6, "{format}: {times:?}");
    }
    // Twelve hours are exact.
    let mut table = open_said(&column("when", &["45356.5"]), &said(Some("excel"), None)).unwrap();
    assert_eq!(read(&mut table).1, [AT - 34_200.0]);
    // A column of dates with such numbers is not taken as seconds without a word, and `2024065` only by its name.
    let mut table = open_said(&column("Date", &["45356.5", "45357.5"]), &Dialect::default()).unwrap();
    assert!(
        table
            .find_time()
            .unwrap_err()
            .to_string()
            .contains("--time-format excel")
    );
    assert_eq!(read(&mut open(&column("date", &["2024065", "2024066"]))).1, [AT - 77_400.0, AT + 9000.0]);
    assert_eq!(read(&mut open(&column("time", &["2024065", "2024066"]))).1, [2_024_065.0, 2_024_066.0]);
    let mut table = open_said(&column("when", &["10:05.5"]), &said(Some("%M:%S%.f"), None)).unwrap();
    assert_eq!(read(&mut table).1, [605.5]);
}

#[test]
fn letters_of_a_zone_need_its_region() {
    // The doubled hour of a change of the clocks is told apart by them.
    let cells = ["2018-10-28 02:30:00 CEST", "2018-10-28 02:30:00 CET"];
    let mut table = open_said(&column("when", &cells), &Dialect::default()).unwrap();
    table.set_time(&["when"]).unwrap();
    assert!(refusal(&mut table).contains("--time-zone Europe/Berlin"));
    let mut table = open_said(&column("when", &cells), &said(None, Some("Europe/Berlin"))).unwrap();
    assert_eq!(read(&mut table), (Scale::Utc, vec![1_540_686_600.0, 1_540_690_200.0]));
    for zone in ["America/New_York", "+01:00"] {
        let mut table = open_said(&column("when", &cells), &said(None, Some(zone))).unwrap();
        assert!(refusal(&mut table).contains("--time-zone"), "{zone}");
    }
}

#[test]
fn parts_of_a_date_in_columns() {
    for (names, cells) in [
        ("Datum,Zeit", "05.03.2024,21:30"),
        ("Zeit,Datum", "21:30,05.03.2024"),
        ("Date,Time", "20240305,213000"),
        ("date,hhmm", "20240305,2130"),
        ("Year,DOY,HHMM", "2024,65,2130"),
        ("YY,MM,DD,hh,mm", "2024,03,05,21,30"),
        ("Year,Month,Day,Time", "2024,3,5,21:30"),
    ] {
        let text = format!("{names},x\n{cells},1\n{cells},2\n");
        let mut table = open_said(&text, &Dialect::default()).unwrap();
        if names.starts_with("Zeit") {
            table.set_time(&["Datum", "Zeit"]).unwrap();
        } else {
            assert!(table.find_time().unwrap(), "{text}");
        }
        assert_eq!(read(&mut table), (Scale::Local, vec![AT, AT]), "{text}");
        assert_eq!(table.selected().len(), 1, "{text}");
    }
    // Zeros that were lost, midnight that ends a day, and columns without names.
    let mut table = open("date,time,x\n20240305,5,1\n20240305,930,2\n20240305,2130,3\n");
    assert_eq!(read(&mut table).1, [AT - 77_100.0, AT - 43_200.0, AT]);
    let mut table = open("Datum,Zeit,x\n31.12.2023,24:00,1\n01.01.2024,00:10,2\n");
    assert_eq!(read(&mut table).1, [1_704_067_200.0, 1_704_067_800.0]);
    let bare = Dialect {
        no_header: Some(true),
        time_column: ["#1", "#2", "#3", "#4"].map(str::to_owned).into(),
        ..Dialect::default()
    };
    let mut table = open_said("2024 03 05 21   195\n2024 03 05 22  -200\n", &bare).unwrap();
    assert_eq!(read(&mut table).1, [AT - 1800.0, AT + 1800.0]);
}

#[test]
fn numbers_and_clocks_beside_the_time_are_none() {
    // Lots whose numbers are dates, beside seconds; sunrise and sunset beside a day.
    let mut table = open("time,lot,x\n1,20240305,5\n2,20240306,6\n");
    assert_eq!(read(&mut table), (Scale::Seconds, vec![1.0, 2.0]));
    let mut table = open("Date,Sunrise,Sunset\n2024-03-05,06:30,18:00\n2024-03-06,06:28,18:02\n");
    assert_eq!(read(&mut table), (Scale::Local, vec![AT - 77_400.0, AT + 9000.0]));
}

#[test]
fn the_first_column_is_the_time_only_if_it_increases() {
    for (text, is_time) in [
        ("n,x\n1,5\n2,5\n3,5\n", true),
        ("station,x\n44,5\n44,6\n44,7\n", false),
        ("value,x\n9,5\n3,5\n7,5\n2,6\n8,1\n1,2\n", false),
    ] {
        let outcome = open_said(text, &Dialect::default()).unwrap().require_time();
        match (is_time, outcome) {
            (true, outcome) => outcome.unwrap(),
            (false, outcome) => assert!(outcome.unwrap_err().to_string().contains("--time-column"), "{text}"),
        }
    }
}
