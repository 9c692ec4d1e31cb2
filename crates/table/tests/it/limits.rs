//! Cells that say only on which side of a number a measurement is.

use super::{numbers, open, refusal, rows};
use fewbits_table::{Kind, Side};

/// Cells as `<0.25` are numbers with a side, where they are asked for, also in columns in which they are more than the numbers.
#[test]
fn limits_are_numbers_with_a_side() {
    let mut text = "time,lead,word\n".to_owned();
    for row in 0..600 {
        let cell = match row % 3 {
            0 => "<0.25".to_owned(),
            1 => format!("> {}", 40 + row),
            _ => format!("{}.5", row),
        };
        text += &format!("{row},{cell},{}\n", if row % 2 == 0 { "<on" } else { "off" });
    }
    let mut table = open(&text);
    table.find_time().unwrap();
    assert!(table.take_limits(None));
    let lead = table.position("lead").unwrap();
    assert_eq!(table.columns()[lead].kind, Kind::Number);
    assert_eq!(table.columns()[table.position("word").unwrap()].kind, Kind::Words);
    table.select(&["lead"]).unwrap();
    let batch = rows(&mut table);
    let cells = numbers(&batch.columns[0]);
    assert_eq!(cells[..3], [Some(0.25), Some(41.0), Some(2.5)]);
    assert_eq!(batch.limits[..2], [(0, 0, Side::Below), (0, 1, Side::Above)]);
    assert_eq!(batch.limits.len(), 400);
    // With a decimal comma, and the sign of "at most".
    let mut table = open("t;x\n0;1,5\n1;≤0,25\n2;>=7,5\n");
    assert!(table.take_limits(None));
    table.select(&["x"]).unwrap();
    let batch = rows(&mut table);
    assert_eq!(numbers(&batch.columns[0]), [Some(1.5), Some(0.25), Some(7.5)]);
    assert_eq!(batch.limits, [(0, 1, Side::Below), (0, 2, Side::Above)]);
    // Unasked, they are what they were.
    let message = refusal(&mut open("t,x\n0,1.5\n1,2.5\n2,<0.25\n"));
    assert!(message.contains("`<0.25` is not a number"), "{message}");
}

/// Defect: the first cell of a table of one column without times was taken for its name if it is a limit.
#[test]
fn a_limit_is_no_name() {
    for (text, values) in [
        ("lead\n<0.1\n0.5\n>40\n", [Some(0.1), Some(0.5), Some(40.0)]),
        ("a title\nlead\n≤ 0.1\n<0.2\n1.5\n", [Some(0.1), Some(0.2), Some(1.5)]),
    ] {
        let mut table = open(text);
        assert_eq!(table.columns()[0].name, "lead");
        assert!(table.take_limits(None));
        assert_eq!(numbers(&rows(&mut table).columns[0]), values);
    }
}
