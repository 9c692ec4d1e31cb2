//! Long tables made wide.

use super::{numbers, open_said, rows};
use fewbits_table::{Batch, Dialect, Error, Table};

fn wide(text: &str, by: &str) -> Result<Table, Error> {
    let mut table = open_said(text, &Dialect::default())?;
    table.find_time()?;
    let mut table = table.widened(by, &[])?;
    table.set_time(&["#1"])?;
    Ok(table)
}

fn names(table: &Table) -> Vec<&str> {
    table
        .selected()
        .iter()
        .map(|i| table.columns()[*i].name.as_str())
        .collect()
}

#[test]
fn a_column_per_sensor_and_a_row_per_time() {
    let text = "entity_id,state,last_changed\nt,20.5,2024-03-05T00:00:00Z\nlamp,on,2024-03-05T00:00:00Z\nt,21.5,2024-03-05T01:00:00Z\n\
                lamp,unavailable,2024-03-05T02:00:00Z\n\"a, b\",9007199254740993,2024-03-05T02:00:00Z\n";
    let table = wide(text, "entity_id").unwrap();
    assert_eq!(names(&table), ["t", "lamp", "a, b"]);
    // Each sensor has a kind of its own.
    let survey = wide(text, "entity_id").unwrap().survey().unwrap();
    let kinds: Vec<String> = survey.columns.iter().map(|column| column.kind().to_string()).collect();
    assert_eq!(kinds[1..], ["number", "boolean", "integer"]);
    let mut table = table;
    table.use_survey(&survey);
    let batch = rows(&mut table);
    assert_eq!(numbers(&batch.columns[0]), [Some(20.5), Some(21.5), None]);
    assert_eq!(numbers(&batch.columns[1]), [Some(1.0), None, None]);
    assert_eq!(batch.columns[2], fewbits_table::Cells::Integers(vec![None, None, Some(9_007_199_254_740_993)]));
    // Places are those of the long table.
    assert_eq!(batch.places.iter().map(|place| place.line).collect::<Vec<_>>(), [2, 4, 5]);
    assert_eq!(survey.times.steps, Some((3600.0, 3600.0)));
}

#[test]
fn rows_by_sensor_are_sorted_and_repeats_are_kept() {
    let mut text = "Series;Time;Value\n".to_owned();
    for series in ["a", "b"] {
        for i in 0..50 {
            text += &format!("{series};{};{},5\n", 1_700_000_000 + 60 * i, if series == "a" { i } else { -i });
        }
    }
    let batch = rows(&mut wide(&text, "Series").unwrap());
    assert_eq!(batch.rows, 50);
    for (i, cell) in numbers(&batch.columns[1]).into_iter().enumerate() {
        let i = i as f64;
        assert_eq!(cell, Some(if i == 0.0 { 0.5 } else { -i - 0.5 }), "{i}");
        assert_eq!(numbers(&batch.columns[0])[i as usize], Some(i + 0.5));
    }
    // A second reading at one time is a row of that time.
    let batch = rows(&mut wide("time,id,x\n0,a,1\n0,b,2\n0,a,3\n1,a,4\n", "id").unwrap());
    assert_eq!(numbers(&batch.columns[0]), [Some(1.0), Some(3.0), Some(4.0)]);
    assert_eq!(numbers(&batch.columns[1]), [Some(2.0), None, None]);
}

#[test]
fn several_values_and_refusals() {
    let text = "time,id,temp,rh\n0,a,1.5,40\n0,b,2.5,41\n1,a,x y,42\n";
    let mut table = wide(text, "id").unwrap();
    assert_eq!(names(&table), ["a.temp", "a.rh", "b.temp", "b.rh"]);
    let mut batch = Batch::default();
    assert_eq!(table.read(&mut batch, 9).unwrap(), 1);
    let message = table.read(&mut batch, 9).unwrap_err().to_string();
    assert!(message.starts_with("line 4 (row 2), column `a.temp`: `x y`"), "{message}");
    for (text, by, mend) in [
        ("id,x\na,1\nb,2\n", "id", "--time-column"),
        ("time,id\n0,a\n", "id", "beside one of values"),
        ("time,id,x\n0,a,1\n", "name", "no column `name`"),
    ] {
        let message = wide(text, by).err().unwrap().to_string();
        assert!(message.contains(mend), "{message}");
    }
    // No rows are no sensors.
    assert_eq!(names(&wide("time,id,x\n", "id").unwrap()), [""; 0]);
}
