//! Times as they are written, against seconds since 1970 that were computed elsewhere (GNU date).

use super::{open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Scale, Table, Time};

fn column(cells: &[&str]) -> String {
    format!("when;x\n{}", cells.iter().map(|cell| format!("{cell};1\n")).collect::<String>())
}

fn read(table: &mut Table) -> (Scale, Vec<f64>) {
    let scale = table.time().unwrap().1;
    (scale, seconds(&rows(table)))
}

#[test]
fn spellings_of_times() {
    use Scale::{Local, Seconds, Utc};
    for (cells, scale, expected) in [
        (&["2023-11-14T22:13:20Z"][..], Utc, &[1_700_000_000.0][..]),
        (
            &["2023-11-15T00:13:20+02:00", "2023-11-14T15:13:20.5-0700"],
            Utc,
            &[1_700_000_000.0, 1_700_000_000.5],
        ),
        (&["2023-11-15 09:13:20 +11"], Utc, &[1_700_000_000.0]),
        (&["2023-11-14 22:13", "2023-11-14 9:42"], Local, &[1_699_999_980.0, 1_699_954_920.0]),
        (&["2023/11/14 22:13:20"], Local, &[1_700_000_000.0]),
        (&["2023-11-14_22:13:20"], Local, &[1_700_000_000.0]),
        (&["20.11.2023 00:00", "01.01.1990 00:00"], Local, &[1_700_438_400.0, 631_152_000.0]),
        (&["11/14/23", "11/15/2023"], Local, &[1_699_920_000.0, 1_700_006_400.0]),
        (&["14/11/23 10:13:20 PM", "13/11/23 12:00:00 a.m."], Local, &[1_700_000_000.0, 1_699_833_600.0]),
        (&["14-Nov-2023 22:13:20"], Local, &[1_700_000_000.0]),
        (&["1952-01-01T00:00:00", "1969-12-31T23:59:59"], Local, &[-568_080_000.0, -1.0]),
        (&["2018-01-01 24:00:00"], Local, &[1_514_851_200.0]),
        (&["2023-11-14T22:13:20,25Z"], Utc, &[1_700_000_000.25]),
        (&["1700000000", "1700000000.25"], Seconds, &[1_700_000_000.0, 1_700_000_000.25]),
        (&["1700000000000", "1700000000250"], Utc, &[1_700_000_000.0, 1_700_000_000.25]),
        (&["1700000000250000"], Utc, &[1_700_000_000.25]),
        (&["1700000000250000000"], Utc, &[1_700_000_000.25]),
        (&["00:00:01.5", "9:42"], Seconds, &[1.5, 34_920.0]),
        (&["-0.125", "1.5e2"], Seconds, &[-0.125, 150.0]),
    ] {
        let text = column(cells);
        let mut table = open_said(&text, &Dialect::default()).unwrap();
        table.set_time(&["when"]).unwrap();
        assert_eq!(read(&mut table), (scale, expected.to_vec()), "{text}");
    }
}

#[test]
fn day_and_month_are_not_guessed() {
    let text = column(&["1/2/2023", "3/4/2023"]);
    let mut table = open_said(&text, &Dialect::default()).unwrap();
    let message = table.set_time(&["when"]).unwrap_err().to_string();
    assert!(message.contains("--time-format dmy or --time-format mdy"), "{message}");
    for (order, first) in [
        ("dmy", 1_675_209_600.0),
        ("mdy", 1_672_617_600.0),
        ("%d/%m/%Y", 1_675_209_600.0),
    ] {
        let said = Dialect {
            time_format: Some(order.to_owned()),
            time_column: vec!["when".to_owned()],
            ..Dialect::default()
        };
        assert_eq!(read(&mut open_said(&text, &said).unwrap()).1[0], first);
    }
}

#[test]
fn formats_and_zones_are_said() {
    let said = |format: Option<&str>, zone: Option<&str>| Dialect {
        time_format: format.map(str::to_owned),
        time_zone: zone.map(str::to_owned),
        time_column: vec!["when".to_owned()],
        ..Dialect::default()
    };
    let one = |cell: &str, said: &Dialect| read(&mut open_said(&column(&[cell]), said).unwrap());
    assert_eq!(one("20231114-221320", &said(Some("%Y%m%d-%H%M%S"), None)), (Scale::Local, vec![1_700_000_000.0]));
    assert_eq!(one("2023-11-14 22:13:20", &said(None, Some("+01:00"))), (Scale::Utc, vec![1_699_996_400.0]));
    assert_eq!(one("2023-07-14 22:13:20", &said(None, Some("Europe/Berlin"))), (Scale::Utc, vec![1_689_365_600.0]));
    assert_eq!(one("1459334", &said(Some("ms"), None)), (Scale::Seconds, vec![1459.334]));
    // An hour that a change of the clocks doubles, and one that it leaves out.
    for cell in ["2018-10-28 02:30:00", "2018-03-25 02:30:00"] {
        let mut table = open_said(&column(&[cell]), &said(None, Some("Europe/Berlin"))).unwrap();
        assert!(refusal(&mut table).contains("--time-zone +01:00"));
    }
}

#[test]
fn times_of_several_columns() {
    let mut table = open("Date,Time,x\n2023-11-14,22:13:20,1\n2023-11-14,9:42,2\n");
    assert_eq!(read(&mut table), (Scale::Local, vec![1_700_000_000.0, 1_699_954_920.0]));
    let mut table =
        open_said("year,month,day,hour,x\n2023,11,14,22,1\n2023,11,14,24,2\n", &Dialect::default()).unwrap();
    table.set_time(&["year", "month", "day", "hour"]).unwrap();
    assert_eq!(read(&mut table), (Scale::Local, vec![1_699_999_200.0, 1_700_006_400.0]));
}

#[test]
fn what_cannot_be_kept_is_refused() {
    for (cell, word) in [
        ("2016-12-31T23:59:60Z", "leap second"),
        ("2023-02-30T00:00:00Z", "calendar"),
        ("2023-11-14T25:13:20Z", "not a time"),
        ("2023-11-14T22:13:20", "offset"),
        ("", "empty"),
    ] {
        let text = column(&["2023-11-14T22:13:20Z", cell]);
        let mut table = open_said(&text, &Dialect::default()).unwrap();
        table.set_time(&["when"]).unwrap();
        let message = refusal(&mut table);
        assert!(message.contains(word) && message.starts_with("line 3 (row 2), column `when`"), "{message}");
    }
    // A leap second is taken where times may be a second off.
    let mut table = open_said(&column(&["2016-12-31T23:59:59Z", "2016-12-31T23:59:60Z"]), &Dialect::default()).unwrap();
    table.set_time(&["when"]).unwrap();
    table.allow_inexact_times(1_000_000_000);
    assert_eq!(read(&mut table).1, [1_483_228_799.0, 1_483_228_800.0]);
}

#[test]
fn decimals_and_steps_are_counted() {
    for (cells, decimals, steps) in [
        (vec!["0", "1", "2.5", "3.5"], 1, (1.0, 1.5)),
        (vec!["0.000000000000000001", "1"], 18, (1.0 - 1e-18, 1.0)),
        (vec!["0.0000001", "20.0000001", "40.00025"], 7, (20.0, 20.000_249_9)),
        (vec!["0.120", "0.240", "0.350"], 2, (0.11, 0.12)),
        (vec!["-0.5", "9999999999"], 1, (9_999_999_999.5, 9_999_999_999.5)),
    ] {
        let rows: String = cells.iter().map(|cell| format!("{cell},1\n")).collect();
        let survey = open(&format!("time,x\n{rows}")).survey().unwrap();
        assert_eq!((survey.times.decimals, survey.times.steps), (decimals, Some(steps)), "{cells:?}");
    }
    let needed = |cell: &str| {
        let mut table = open(&format!("time,x\n{cell},1\n"));
        rows(&mut table).times[0].decimals()
    };
    for places in 1..=18_usize {
        assert_eq!(usize::from(needed(&format!("7.{:0>places$}", 3))), places);
        assert_eq!(usize::from(needed(&format!("-7.{:0<places$}", "10"))), 1);
    }
}

#[test]
fn all_decimals_are_kept() {
    let mut table = open_said(&column(&["0.30000000000000004", "2", "1e-3"]), &Dialect::default()).unwrap();
    table.set_time(&["when"]).unwrap();
    let batch = rows(&mut table);
    assert_eq!(batch.times[0].shown(Scale::Seconds, 18), "0.30000000000000004");
    assert_eq!(batch.times.iter().map(|time| time.decimals()).collect::<Vec<_>>(), [17, 0, 3]);
    assert_eq!(batch.times[0].ticks(9), Some((300_000_000, false)));
    assert_eq!(batch.times[0].ticks(17), Some((30_000_000_000_000_004, true)));
    let mut table = open_said(&column(&["2023-11-14T22:13:20.0123456789Z"]), &Dialect::default()).unwrap();
    table.set_time(&["when"]).unwrap();
    let time = rows(&mut table).times[0];
    assert_eq!(time.shown(Scale::Utc, 10), "2023-11-14T22:13:20.0123456789Z");
    assert_eq!(Time::from_ticks(-568_080_000_000, 3).shown(Scale::Local, 0), "1952-01-01T00:00:00");
    assert_eq!(Time::from_ticks(i64::MIN, 0).ticks(1), None);
}

/// A count of seconds whose name says its unit.
#[test]
fn times_by_short_names_with_units() {
    for name in ["t", "t_s", "T [s]", "t/s", "seconds"] {
        let mut table = open(&format!("x,{name}\n4,0\n5,0.25\n7,0.5\n"));
        assert!(table.time().is_some(), "{name}");
        assert_eq!(read(&mut table).1, [0.0, 0.25, 0.5], "{name}");
    }
}

/// Defect: of a time with more decimals than are kept and an exponent, the last digit of the exponent was cut off.
#[test]
fn small_times_of_many_digits_with_an_exponent() {
    let mut table = open("time,x\n8e-06,1\n9.999999999999999e-06,2\n1.1e-05,3\n1.2345678901234567E-04,4\n");
    table.find_time().unwrap();
    table.allow_inexact_times(2);
    let found = read(&mut table).1;
    for (found, truth) in found.iter().zip([8e-6, 1e-5, 1.1e-5, 1.234_567_890_123_456_7e-4]) {
        assert!((found - truth).abs() < 1e-9, "{found} {truth}");
    }
    assert_eq!(found.len(), 4);
}
