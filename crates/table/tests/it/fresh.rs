//! Units of times in names, dates that later rows decide, settings of oscilloscopes, long tables that are read as wide ones.

use super::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Scale, Table};

fn lines(header: &str, count: usize, row: impl Fn(usize) -> String) -> String {
    (0..count).fold(header.to_owned() + "\n", |text, i| text + &row(i) + "\n")
}

#[test]
fn units_in_names_hold_for_times_since_any_zero() {
    for (name, format, unit, left) in [
        ("time_ms", "ms", 1e-3, "time"),
        ("Time (ms)", "ms", 1e-3, "Time"),
        ("t_us", "us", 1e-6, "t"),
        ("t [ns]", "ns", 1e-9, "t"),
        ("elapsedMs", "ms", 1e-3, "elapsed"),
        ("timestamp_ms", "ms", 1e-3, "timestamp"),
        ("time_min", "min", 60.0, "time"),
        ("Time [h]", "h", 3600.0, "Time"),
        ("time (days)", "d", 86_400.0, "time"),
    ] {
        let text = lines(&format!("{name},x"), 30, |i| format!("{},{i}", 25 * i));
        let mut table = Table::open(std::io::Cursor::new(text), &Dialect::default()).unwrap();
        table.require_time().unwrap();
        assert_eq!(table.dialect().time_format.as_deref(), Some(format), "{name}");
        // What is written anew are seconds: a name with another unit would change them when they are read again.
        assert_eq!(table.time_name(), Some(left), "{name}");
        assert_eq!(table.time().unwrap().1, Scale::Seconds);
        let found = seconds(&rows(&mut table));
        assert!((found[29] - 725.0 * unit).abs() <= 1e-12 * found[29], "{name}: {}", found[29]);
    }
    // Names that say seconds, or nothing, leave numbers as they are.
    for name in ["time", "Time (s)", "t", "timestamp", "seconds"] {
        let mut table = open(&lines(&format!("{name},x"), 30, |i| format!("{},{i}", 25 * i)));
        assert_eq!((table.time_name(), table.dialect().time_format.clone()), (Some(name), None));
        assert_eq!(seconds(&rows(&mut table))[29], 725.0);
    }
}

#[test]
fn a_row_of_units_holds_for_times() {
    let mut table = open(&lines("Time\tFlow\n[ms]\t[l/min]", 30, |i| format!("{}\t{i}", 250 * i)));
    assert_eq!(seconds(&rows(&mut table))[3], 0.75);
    let mut table = open(&lines("Time\tFlow\n[s]\t[l/min]", 30, |i| format!("{}\t{i}", 250 * i)));
    assert_eq!(seconds(&rows(&mut table))[3], 750.0);
}

#[test]
fn times_since_1970_keep_their_size_and_their_unit() {
    let of = |name: &str, number: u64| {
        let mut table = open(&lines(&format!("{name},x"), 3, |i| format!("{},{i}", number + i as u64)));
        (table.time().unwrap().1, seconds(&rows(&mut table))[0])
    };
    assert_eq!(of("time_ms", 1_709_674_200_000), (Scale::Utc, 1_709_674_200.0));
    assert_eq!(of("time_s", 1_709_674_200_000), (Scale::Utc, 1_709_674_200.0));
    assert_eq!(of("time_us", 1_709_674_200_000_000), (Scale::Utc, 1_709_674_200.0));
    // Twenty days since a start in millionths have the size of times since 1970 in thousandths.
    assert_eq!(of("time_us", 1_709_674_200_000), (Scale::Seconds, 1_709_674.2));
}

#[test]
fn short_years_may_stand_first() {
    let mut table = Table::open(
        std::io::Cursor::new(lines("time,x", 9, |i| format!("24/03/{:02} 10:00,{i}", i + 1))),
        &Dialect::default(),
    )
    .unwrap();
    let message = table.find_time().unwrap_err().to_string();
    assert!(message.contains("year first or last") && message.contains("--time-format ymd"), "{message}");
    let mut table = open(&lines("time,x", 20, |i| format!("{:02}/03/24 10:00,{i}", i + 1)));
    let (batch, scale) = (rows(&mut table), table.time().unwrap().1);
    assert_eq!(batch.times[19].shown(scale, 0), "2024-03-20T10:00:00");
}

#[test]
fn all_rows_tell_the_order_of_day_and_month() {
    let date = |i: usize| (1 + i / 500, 2 + i / 14_500);
    for (order, row) in [
        (
            "dmy",
            Box::new(|i| format!("{:02}/{:02}/2024 10:{:02},{i}", date(i).0, 2, i % 60))
                as Box<dyn Fn(usize) -> String>,
        ),
        ("mdy", Box::new(|i| format!("{:02}/{:02}/2024 10:{:02},{i}", 2, date(i).0, i % 60))),
    ] {
        let text = lines("date,x", 7000, row);
        let mut table = Table::open(std::io::Cursor::new(text.clone()), &Dialect::default()).unwrap();
        assert!(table.find_time().unwrap_err().is_day_or_month());
        let table = Table::open(std::io::Cursor::new(text), &Dialect::default()).unwrap();
        assert_eq!(table.survey().unwrap().columns[0].day_order(), Some(order));
    }
    let text = lines("date,x", 20, |i| format!("03/0{}/2024,{i}", 1 + i % 9));
    let table = Table::open(std::io::Cursor::new(text), &Dialect::default()).unwrap();
    assert_eq!(table.survey().unwrap().columns[0].day_order(), None);
}

#[test]
fn settings_beside_the_first_rows() {
    let settings = [
        "Record Length,3e1,Points",
        "Sample Interval,1e-6,s",
        "Trigger Point,15,Samples",
        ",,",
        "Source,CH2,",
        "Vertical Units,V,",
    ];
    let row = |i: usize| {
        format!("{},{:09.6},  {:.3},", settings.get(i).unwrap_or(&",,"), -1.5e-3 + 1e-4 * i as f64, 0.5 * i as f64)
    };
    let text = (0..30).map(|i| row(i) + "\n").collect::<String>();
    let mut table = open(&text);
    assert_eq!(table.dialect().format.as_deref(), Some("Tektronix"));
    let selected: Vec<&str> = table
        .selected()
        .iter()
        .map(|i| table.columns()[*i].name.as_str())
        .collect();
    assert_eq!(selected, ["CH2"]);
    let batch = rows(&mut table);
    assert_eq!((batch.rows, seconds(&batch)[29]), (30, 1.4e-3));
    assert_eq!(numbers(&batch.columns[0])[29], Some(14.5));
    // Said, it is no longer known.
    let said = Dialect {
        no_header: Some(true),
        ..Dialect::default()
    };
    assert_eq!(open_said(&text, &said).unwrap().selected().len(), 5);
}

#[test]
fn readings_of_several_sensors_name_the_option() {
    let states = ["on", "21.5", "off", "heating"];
    let text = lines("entity_id,state,last_changed", 1200, |i| {
        let state = if i % 2 == 0 {
            format!("{}.5", i)
        } else {
            states[i % 4].to_owned()
        };
        format!("sensor.s{},{state},2024-03-05T10:{:02}:{:02}Z", i % 4, i / 60 % 60, i % 60)
    });
    let mut table = open(&text);
    let readings = table.readings().unwrap();
    assert_eq!((readings.by.as_str(), readings.value.as_str()), ("entity_id", "state"));
    let message = refusal(&mut table);
    assert!(message.contains("--by entity_id --columns state"), "{message}");
    // A table of words and values that is not long.
    let text = lines("time,mode,value", 30, |i| format!("{i},m{},{i}", i % 3));
    assert_eq!(open(&text).readings(), None);
}
