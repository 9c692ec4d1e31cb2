//! `fewbits fit`: faults that are named, and what follows from the file.

use crate::numbers::Numbers;
use crate::{fewbits, good, text};

/// Defect: a logger that drops values above a limit made the noises and the change wrong by several of their errors, without a word.
#[test]
fn dropped_values_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(5);
    let (mut level, mut table) = (20.0, "time,all,some\n".to_owned());
    for row in 0..400 {
        level += 0.5 * numbers.normal() - 0.05 * (level - 20.0);
        let (all, some) = (level + 0.3 * numbers.normal(), level + 0.5 * numbers.normal());
        let some = if some > 21.0 {
            String::new()
        } else {
            format!("{some:.4}")
        };
        table += &format!("{row},{all:.4},{some}\n");
    }
    let output = fewbits(folder.path(), &["fit", "-", "-o", "found.json"], table.as_bytes());
    let page = text(&output.stdout);
    assert!(page.contains("some: its values above 2") && page.contains("are missing"), "{page}");
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    let fault = &found["faults"][0];
    assert!(fault[0] == "some" && fault[1] == "absent-above", "{found}");
    assert!((fault[2].as_f64().unwrap() - 21.0).abs() < 0.1, "{found}");
    let noise = found["sensors"][1]["noise"].as_f64().unwrap();
    assert!((noise / 0.5).ln().abs() < 0.2, "{found}");
}

/// Defect: `track` refused a level that returns in milliseconds, whose change after a second is that in the long run.
#[test]
fn a_fast_level_that_returns_is_tracked() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(6);
    let (mut level, mut table) = (0.0, "time,a\n".to_owned());
    for row in 0..400 {
        level += 0.5 * numbers.normal() - 0.1 * level;
        table += &format!("{:.4},{:.4}\n", 1e-3 * f64::from(row), level + 0.2 * numbers.normal());
    }
    good(folder.path(), &["fit", "-", "--find", "time-constant", "-o", "found.json"], table.as_bytes());
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    assert!((0.003..0.03).contains(&found["time_constant"].as_f64().unwrap()), "{found}");
    let estimates = text(&good(folder.path(), &["track", "-", "--settings", "found.json"], table.as_bytes()));
    assert_eq!(estimates.lines().count(), 401);
}

/// Defect: a design of headings about north took 359 and 1 degrees for far apart without a word.
#[test]
fn a_design_of_angles_says_how_to_turn_them() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(7);
    let said = |values: &mut dyn FnMut() -> f64| {
        let mut table = "heading\n".to_owned();
        (0..300).for_each(|_| table += &format!("{:.3}\n", values()));
        let words = [
            "design", "-", "--column", "heading", "--noise", "1", "--bits", "1", "--json",
        ];
        text(&fewbits(folder.path(), &words, table.as_bytes()).stderr)
    };
    let north = said(&mut || (20.0 * numbers.normal()).rem_euclid(360.0));
    assert!(north.contains("0 to 360: if these are angles") && north.contains("remainder by 360"), "{north}");
    let turn: f64 = north
        .split("add ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next()?.parse().ok())
        .unwrap();
    // The values are about 0, so that half a turn puts them into the middle.
    assert!((turn - 180.0).abs() < 60.0, "{north}");
    let south = said(&mut || 180.0 + 20.0 * numbers.normal());
    assert!(!south.contains("angles"), "{south}");
}
