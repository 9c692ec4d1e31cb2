//! `fewbits fit`, and `track` with what it found.

use crate::numbers::Numbers;
use crate::{good, refused, text};

/// A reference, a sensor with offset and gain, and a switch at 21.
fn table(numbers: &mut Numbers, rows: usize) -> (String, Vec<f64>) {
    let (mut level, mut truth) = (20.0, Vec::new());
    let mut table = "time,right,other,switch\n".to_owned();
    for row in 0..rows {
        level += 0.5 * numbers.normal() - 0.05 * (level - 20.0);
        truth.push(level);
        let right = level + 0.1 * numbers.normal();
        let other = 1.2 * level - 3.0 + 0.4 * numbers.normal();
        let switch = u8::from(level + 0.3 * numbers.normal() > 21.0);
        table += &format!("{row},{right:.4},{other:.4},{switch}\n");
    }
    (table, truth)
}

#[test]
fn what_was_found_is_shown_stored_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let (table, truth) = table(&mut Numbers(3), 400);
    std::fs::write(folder.path().join("t.csv"), &table).unwrap();
    let words = [
        "fit",
        "t.csv",
        "--reference",
        "right",
        "--bits",
        "switch",
        "--find",
        "gain",
        "-o",
        "found.json",
    ];
    let page = text(&good(folder.path(), &words, b""));
    assert!(page.contains("threshold of switch") && page.contains("other is explained"), "{page}");
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    let sensor = |at: usize, name: &str| found["sensors"][at][name].as_f64().unwrap();
    assert!((sensor(1, "gain") - 1.2).abs() < 0.05 && (sensor(1, "bias") + 3.0).abs() < 1.0, "{found}");
    assert!((sensor(2, "threshold") - 21.0).abs() < 0.3, "{found}");
    // The faulty sensor alone, corrected.
    let words = [
        "track",
        "t.csv",
        "--columns",
        "other",
        "--settings",
        "found.json",
        "--json",
    ];
    let out = text(&good(folder.path(), &words, b""));
    let mut squares = 0.0;
    for (row, truth) in out.lines().zip(&truth) {
        let row: serde_json::Value = serde_json::from_str(row).unwrap();
        squares += (row["level"].as_f64().unwrap() - truth).powi(2);
    }
    let error = (squares / truth.len() as f64).sqrt();
    assert!(error < 0.35, "{error}");
}

#[test]
fn what_a_table_cannot_tell_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let (table, _) = table(&mut Numbers(4), 200);
    std::fs::write(folder.path().join("t.csv"), &table).unwrap();
    let alone = text(&good(folder.path(), &["fit", "t.csv", "--columns", "right", "--find", "gain,delay"], b""));
    for fault in ["offset of right", "gain of right", "delay of right"] {
        assert!(alone.contains(&format!("not found: {fault}: with one sensor")), "{fault}: {alone}");
    }
    let bits = refused(folder.path(), &["fit", "t.csv", "--columns", "switch", "--bits", "switch"], b"");
    assert!(bits.contains("bits alone leave unit and zero"), "{bits}");
    let none = refused(folder.path(), &["fit", "t.csv", "--reference", "nobody"], b"");
    assert!(none.contains("no sensor `nobody`"), "{none}");
    let words = ["fit", "t.csv", "--columns", "right,other", "--bits", "other"];
    assert!(refused(folder.path(), &words, b"").contains("is no bit"));
    std::fs::write(folder.path().join("x.json"), "{}").unwrap();
    let words = ["track", "t.csv", "--columns", "right", "--settings", "x.json"];
    assert!(refused(folder.path(), &words, b"").contains("no file of `fewbits fit"));
}

/// Defects: `--by` was an option of two structures, of which the one that was not filled was read, so that such a table was refused; rounding was taken for noise.
#[test]
fn single_readings_and_rounded_ones() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(9);
    let (mut level, mut table, mut rounded) = (20.0, "time,name,value\n".to_owned(), "a,b\n".to_owned());
    for row in 0..600 {
        level += 0.1 * numbers.normal();
        let (a, b) = (level + 0.2 * numbers.normal(), level + 3.0 + 0.6 * numbers.normal());
        table +=
            &format!("{},{},{:.4}\n", 7 * row, if row % 3 == 0 { "b" } else { "a" }, if row % 3 == 0 { b } else { a });
        rounded += &format!("{:.0},{:.3}\n", level + 0.2 * numbers.normal(), b);
    }
    let words = ["fit", "-", "--by", "name", "--json"];
    let found: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, table.as_bytes())).unwrap();
    let near = |name: &str, truth: f64, found: &serde_json::Value| {
        let all = found["estimates"].as_array().unwrap();
        let one = all.iter().find(|one| one[0] == name).unwrap();
        let off = (one[1].as_f64().unwrap() - truth) / one[2].as_f64().unwrap();
        assert!(off.abs() < 4.0, "{name}: {one}");
    };
    near("noise of a", 0.2, &found);
    near("noise of b", 0.6, &found);
    near("offset of b", 3.0, &found);
    let words = ["fit", "-", "--json"];
    let found: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, rounded.as_bytes())).unwrap();
    near("noise of a", 0.2, &found);
    let page = text(&good(folder.path(), &["fit", "-"], rounded.as_bytes()));
    assert!(page.contains("a is rounded to 1") && !page.contains("b is rounded"), "{page}");
}
