//! Times whose names say what their cells leave open, times of other calendars and spellings, dates in columns of any order.

use crate::{open, open_said, rows};
use fewbits_table::{Dialect, Scale, Table};

fn table(name: &str, cells: &[&str]) -> String {
    (0..cells.len()).fold(format!("{name};x\n"), |text, i| text + &format!("{};{i}.5\n", cells[i]))
}

fn shown(mut table: Table) -> Vec<String> {
    let scale = table.time().unwrap().1;
    let batch = rows(&mut table);
    batch.times.iter().map(|time| time.shown(scale, 0)).collect()
}

fn times(name: &str, cells: &[&str]) -> Vec<String> {
    shown(open(&table(name, cells)))
}

fn refused(name: &str, cells: &[&str]) -> String {
    let mut table = open_said(&table(name, cells), &Dialect::default()).unwrap();
    table.require_time().unwrap_err().to_string()
}

fn said(name: &str, cells: &[&str], format: &str) -> Vec<String> {
    let dialect = Dialect {
        time_format: Some(format.to_owned()),
        ..Dialect::default()
    };
    let mut table = open_said(&table(name, cells), &dialect).unwrap();
    table.set_time(&["#1"]).unwrap();
    shown(table)
}

#[test]
fn a_pattern_in_the_name_orders_day_and_month() {
    let cells = ["05/03/2024 1:00:00 AM", "06/03/2024 1:00:00 PM"];
    assert_eq!(times("Time (DD/MM/YYYY h:mm:ss A)", &cells), ["2024-03-05T01:00:00", "2024-03-06T13:00:00"]);
    assert_eq!(times("Time (MM/DD/YYYY h:mm:ss A)", &cells), ["2024-05-03T01:00:00", "2024-06-03T13:00:00"]);
    assert_eq!(times("Date (yy/mm/dd)", &["05/03/02", "05/03/03"]), ["2005-03-02T00:00:00", "2005-03-03T00:00:00"]);
    // What the cells say for certain is not overruled.
    assert_eq!(
        times("Date (mm/dd/yyyy)", &["13/03/2024", "14/03/2024"]),
        ["2024-03-13T00:00:00", "2024-03-14T00:00:00"]
    );
    assert!(refused("Date", &["05/03/2024", "06/03/2024"]).contains("--time-format dmy"));
}

#[test]
fn a_unit_since_a_date_counts_from_there() {
    for (name, cells, expected) in [
        ("time (hours since 1970-01-01)", ["0", "6.5"], ["1970-01-01T00:00:00Z", "1970-01-01T06:30:00Z"]),
        (
            "time [days since 2000-01-01 12:00:00]",
            ["0", "366"],
            ["2000-01-01T12:00:00Z", "2001-01-01T12:00:00Z"],
        ),
        (
            "seconds since 2024-03-05T10:00:00+01:00",
            ["0", "90"],
            ["2024-03-05T09:00:00Z", "2024-03-05T09:01:30Z"],
        ),
        (
            "time (minutes since 1900-01-01 00:00)",
            ["1", "2"],
            ["1900-01-01T00:01:00Z", "1900-01-01T00:02:00Z"],
        ),
    ] {
        let mut table = open_said(&table(name, &cells), &Dialect::default()).unwrap();
        table.require_time().unwrap();
        assert_eq!(table.time().unwrap().1, Scale::Utc);
        assert_eq!(shown(table), expected, "{name}");
    }
    assert!(refused("time (months since 1970-01-01)", &["1", "2"]).contains("of different lengths"));
    assert_eq!(times("time since boot", &["1", "2"]), ["1", "2"]);
}

#[test]
fn years_of_other_calendars_are_asked_for() {
    for cells in [
        ["05/03/2567 10:00", "06/03/2567 10:00"],
        ["2567-03-05 10:00", "2567-03-06 10:00"],
    ] {
        let message = refused("time", &cells);
        assert!(message.contains("Buddhist era") && message.contains("--time-format be"), "{message}");
        assert_eq!(said("time", &cells, "be"), ["2024-03-05T10:00:00", "2024-03-06T10:00:00"]);
    }
    // 29 February of a year that is a leap year of one calendar only.
    assert_eq!(said("time", &["29/02/2567", "01/03/2567"], "be"), ["2024-02-29T00:00:00", "2024-03-01T00:00:00"]);
    assert_eq!(said("time", &["2567-03-05", "2567-03-06"], "ymd"), ["2567-03-05T00:00:00", "2567-03-06T00:00:00"]);
    for cells in [["1403/12/10 10:00", "1403/12/11 10:00"], ["1445-08-10", "1445-08-11"]] {
        assert!(refused("time", &cells).contains("Persian or the Islamic calendar"));
        assert_eq!(said("time", &cells, "ymd").len(), 2);
    }
    // A table that reaches from one century to another is of the common era.
    assert_eq!(times("time", &["2400-01-01", "2500-01-01"]).len(), 2);
    assert!(refused("time", &["2460374.5", "2460375.5"]).contains("Julian date"));
}

#[test]
fn dates_of_east_asia_and_hungary() {
    for cell in [
        "2024年3月5日 13:05:00",
        "2024年03月05日13時05分00秒",
        "2024年3月5日 13时05分",
        "2024/3/5 下午 1:05:00",
        "2024-03-05 오후 1:05:00",
        "2024. 3. 5. 13:05:00",
        "2024.03.05. 13:05",
        "2024년 3월 5일 13시 5분",
        "[2024-03-05 13:05:00]",
        "'2024-03-05 13:05:00",
        "=\"2024-03-05 13:05:00\"",
        "20240305-130500",
        "5 de marzo de 2024 13:05",
        "5 марта 2024 13:05",
    ] {
        let second = cell
            .replacen(":05", ":06", 1)
            .replace("05分", "06分")
            .replace("5분", "6분")
            .replace("1305", "1306");
        assert_eq!(times("when", &[cell, &second]), ["2024-03-05T13:05:00", "2024-03-05T13:06:00"], "{cell}");
    }
    assert_eq!(times("quand", &["1er août 2024", "2 août 2024"]), ["2024-08-01T00:00:00", "2024-08-02T00:00:00"]);
}

#[test]
fn parts_of_dates_stand_in_any_order_and_language() {
    let of = |header: &str, row: &dyn Fn(usize) -> String| {
        shown(open(&(1..5).fold(format!("{header}\n"), |text, i| text + &row(i) + "\n")))
    };
    for header in [
        "year,month,day,x",
        "Année,Mois,Jour,x",
        "Año,Mes,Día,x",
        "Jahr,Monat,Tag,x",
    ] {
        assert_eq!(of(header, &|i| format!("2024,3,{i},{i}"))[3], "2024-03-04T00:00:00", "{header}");
    }
    assert_eq!(of("day,month,year,x", &|i| format!("{i},3,2024,{i}"))[3], "2024-03-04T00:00:00");
    assert_eq!(of("month,day,year,hour,x", &|i| format!("3,5,2024,{i},{i}"))[3], "2024-03-05T04:00:00");
    assert_eq!(of("min,year,month,day,x", &|i| format!("7,2024,3,{i},{i}"))[3], "2024-03-04T00:00:00");
    assert_eq!(of("Date,Time,AM/PM,x", &|i| format!("3/15/2024,{i}:05,PM,{i}"))[3], "2024-03-15T16:05:00");
    let netatmo =
        "Name;Lat;Long;ModuleName;ModuleType\n\"a\";52.1;13.2;\"b\";\"c\"\nTimestamp;\"Timezone : Europe/Berlin\";T\n";
    let row = |i: usize| format!("{};\"2023/11/14 23:1{i}:20\";{i}.5\n", 1_700_000_000 + 60 * i);
    let table = open(&(0..5).fold(netatmo.to_owned(), |text, i| text + &row(i)));
    assert_eq!(table.dialect().format.as_deref(), Some("Netatmo"));
    assert_eq!(shown(table)[4], "1700000240");
}

#[test]
fn a_unit_since_an_event_is_that_of_the_name() {
    for (name, unit) in [
        ("hours since start", 3600),
        ("minutes since midnight", 60),
        ("time (days since deployment)", 86_400),
        ("seconds since boot", 1),
        ("Zeit in Stunden", 3600),
        ("temps (heures)", 3600),
    ] {
        let mut table = open_said(&table(name, &["0", "2", "5"]), &Dialect::default()).unwrap();
        table.require_time().unwrap();
        let found: Vec<i64> = rows(&mut table)
            .times
            .iter()
            .map(|time| time.seconds() as i64)
            .collect();
        assert_eq!(found, [0, 2 * unit, 5 * unit], "{name}");
    }
}

#[test]
fn quarters_and_months_are_their_first_days() {
    for cells in [
        ["2025 Q4", "2026 Q1"],
        ["2025-Q4", "2026-Q1"],
        ["2025Q4", "2026Q1"],
        ["Q4 2025", "Q1 2026"],
        ["Q4/2025", "Q1/2026"],
    ] {
        assert_eq!(taken("period", &cells), ["2025-10-01T00:00:00", "2026-01-01T00:00:00"], "{cells:?}");
        // Beside a time they are words.
        let text = format!("time;period\n0;{}\n1;{}\n", cells[0], cells[1]);
        let mut sorted = cells;
        sorted.sort_unstable();
        assert_eq!(open(&text).words(1), sorted, "{cells:?}");
    }
    for cells in [["03/2024", "11/2024"], ["03-2024", "11-2024"], ["3/2024", "11/2024"]] {
        assert_eq!(taken("month", &cells), ["2024-03-01T00:00:00", "2024-11-01T00:00:00"], "{cells:?}");
    }
    for cells in [
        ["2025 Q5", "2026 Q6"],
        ["2025 Q0", "2026 Q44"],
        ["13/2024", "14/2024"],
        ["Q1", "Q2"],
    ] {
        assert!(refused("period", &cells).contains("is not a time"), "{cells:?}");
    }
}

fn taken(name: &str, cells: &[&str]) -> Vec<String> {
    let mut table = open_said(&table(name, cells), &Dialect::default()).unwrap();
    table.require_time().unwrap();
    shown(table)
}
