//! `fewbits track` on tables as devices write them: messages that come twice, accuracies in other forms, clocks that were reset, limits of rounded values,
//! sensors that are stuck for a while.

use crate::numbers::Numbers;
use crate::track_bands::tracked_file;
use crate::track_found::{has_hint, held, of};
use crate::{fewbits, refused, text};
use serde_json::Value;

const ROWS: usize = 500;

/// Levels of a walk about 20.
fn walk(numbers: &mut Numbers, rows: usize, change: f64) -> Vec<f64> {
    let mut level = 20.0;
    let mut next = || {
        level += change * numbers.normal();
        level
    };
    (0..rows).map(|_| next()).collect()
}

/// What is said of a table that is refused.
fn refusal(table: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("t.csv"), table).unwrap();
    refused(folder.path(), &["track", "t.csv"], b"")
}

fn share(rows: &[Value], levels: &[f64]) -> f64 {
    assert_eq!(rows.len(), levels.len());
    let held = rows.iter().zip(levels).filter(|(row, level)| held(row, **level));
    held.count() as f64 / levels.len() as f64
}

/// Defect: a message that came again with the time of its arrival counted as a measurement; bands held one truth in a hundred.
#[test]
fn a_message_that_comes_twice_counts_once() {
    let mut numbers = Numbers(701);
    let levels = walk(&mut numbers, 400, 0.3);
    let (mut table, mut columns, mut truth) = ("time,sensor,value\n".to_owned(), "time,a\n".to_owned(), Vec::new());
    for (k, level) in levels.iter().enumerate() {
        let (time, value) = (10.0 * k as f64, level + numbers.normal());
        let mut times = vec![time];
        if numbers.uniform() < 0.6 {
            times.push(time + 0.01 + 0.4 * numbers.uniform());
        }
        for time in times {
            table += &format!("{time:.3},a,{value:.4}\n");
            columns += &format!("{time:.3},{value:.4}\n");
            truth.push(*level);
        }
    }
    for table in [table, columns] {
        let (rows, summary) = tracked_file(&table, &[]);
        let found = share(&rows, &truth);
        assert!((0.9..0.99).contains(&found), "{found} {summary}");
        assert!(has_hint(&summary, "that repeat the last one within"), "{summary}");
        assert_eq!(summary["reports"], 400, "{summary}");
    }
    // Whole numbers, which are often equal by chance.
    let (mut whole, mut truth) = ("time,a\n".to_owned(), Vec::new());
    for (k, level) in levels.iter().enumerate() {
        let (time, value) = (30.0 * k as f64, (level + 0.5 * numbers.normal()).round());
        let count = 1 + usize::from(numbers.uniform() < 0.4);
        for part in 0..count {
            whole += &format!("{:.1},{value}\n", time + 0.3 * part as f64);
            truth.push(*level);
        }
    }
    let (rows, summary) = tracked_file(&whole, &[]);
    assert!(share(&rows, &truth) > 0.9 && summary["reports"] == 400, "{summary}");
    // A sensor that measures in bursts.
    let mut bursts = "time,a\n".to_owned();
    for (k, level) in levels.iter().enumerate() {
        for part in 0..3 {
            bursts += &format!("{:.1},{:.2}\n", 60.0 * k as f64 + 0.1 * f64::from(part), level + numbers.normal());
        }
    }
    let (_, summary) = tracked_file(&bursts, &[]);
    assert_eq!(summary["reports"], 1200, "{summary}");
}

/// Defect: a column of variances or of half bands was taken for a sensor, and percent for deviations.
#[test]
fn accuracies_in_other_forms_are_deviations() {
    let mut numbers = Numbers(702);
    let levels = walk(&mut numbers, ROWS, 0.5);
    let names = ["accuracy", "variance", "ci95", "accuracy_pct"];
    let mut tables = names.map(|name| format!("time,value,{name}\n"));
    for (k, level) in levels.iter().enumerate() {
        let deviation = 0.2 * (3.0 * numbers.uniform()).exp();
        let value = level + deviation * numbers.normal();
        let stated = [
            deviation,
            deviation.powi(2),
            1.96 * deviation,
            100.0 * deviation / value.abs(),
        ];
        for (table, stated) in tables.iter_mut().zip(stated) {
            *table += &format!("{k},{value:.9},{stated:.12}\n");
        }
    }
    let found = tables.each_ref().map(|table| tracked_file(table, &[]));
    assert!(share(&found[0].0, &levels) > 0.92);
    for (name, (rows, summary)) in names.iter().zip(&found).skip(1) {
        for (row, expected) in rows.iter().zip(&found[0].0) {
            for column in ["level", "level_low"] {
                let off = of(row, column) - of(expected, column);
                assert!(off.abs() < 1e-3, "{name}: {row} {expected}");
            }
        }
        assert!(
            has_hint(summary, &format!("{name} is taken for ")) && has_hint(summary, "as its name says"),
            "{summary}"
        );
    }
    assert!(!has_hint(&found[0].1, "as its name says"));
    // Of humidity in percent, percent are deviations.
    let shares = tables[0].replacen("value,accuracy", "rh,accuracy_pct", 1);
    let (rows, summary) = tracked_file(&shares, &[]);
    assert_eq!(of(&rows[99], "level"), of(&found[0].0[99], "level"));
    assert!(!has_hint(&summary, "as its name says"), "{summary}");
}

/// Defect: accuracies that were two and a half times too small, or twice too large, were not told.
#[test]
fn accuracies_that_values_contradict_are_told() {
    let mut numbers = Numbers(703);
    let levels = walk(&mut numbers, ROWS, 0.5);
    let mut tables = [0.4, 1.0, 2.0].map(|factor| (factor, "time,value,accuracy\n".to_owned()));
    for (k, level) in levels.iter().enumerate() {
        let deviation = 0.2 * (3.0 * numbers.uniform()).exp();
        let value = level + deviation * numbers.normal();
        for (factor, table) in &mut tables {
            *table += &format!("{k},{value:.5},{:.5}\n", *factor * deviation);
        }
    }
    let told = tables.map(|(_, table)| {
        let (_, summary) = tracked_file(&table, &[]);
        let is = |word: &str| {
            let hints = summary["hints"].as_array().unwrap().iter().filter_map(Value::as_str);
            hints
                .into_iter()
                .any(|hint| hint.contains("the accuracies that rows state") && hint.contains(word))
        };
        [is("too narrow"), is("too wide")]
    });
    assert_eq!(told, [[true, false], [false, false], [false, true]]);
}

/// Defect: the ends of a band beside its value counted as sensors of offsets.
#[test]
fn ends_of_a_band_are_no_sensors() {
    let message = refusal("time,level,level_low,level_high\n0,20,19,21\n1,20.2,19.1,21.3\n2,20.1,19,21.2\n");
    assert!(message.contains("--without level_low,level_high"), "{message}");
    // Without that of which they are the ends, they are two places.
    let (_, summary) = tracked_file("time,temp_low,temp_high\n0,20,20.4\n1,20.2,20.1\n2,20.1,19.8\n", &[]);
    assert_eq!(summary["sensors"].as_array().unwrap().len(), 2);
}

/// Defect: the forecast of a temperature counted as a sensor of it.
#[test]
fn a_forecast_beside_its_level_is_no_sensor() {
    let message = refusal("time,temp,temp_forecast\n0,20,20.1\n1,20.2,20.3\n2,20.1,20\n");
    assert!(message.contains("--without temp_forecast"), "{message}");
}

/// Defect: `--late 1772335140s` was proposed, and a pause of 56 years was not told.
#[test]
fn a_clock_that_was_reset_is_named() {
    let mut numbers = Numbers(704);
    let time = |year: u32, k: usize| format!("{year}-01-01T{:02}:{:02}:00", k / 60, k % 60);
    let mut row = |year: u32, k: usize| format!("{},{:.3}\n", time(year, k), 20.0 + 0.3 * numbers.normal());
    let years = |years: [u32; 2], row: &mut dyn FnMut(u32, usize) -> String| {
        let rows: String = (0..200).map(|k| row(years[usize::from(k >= 100)], k)).collect();
        format!("time,a\n{rows}")
    };
    let message = refusal(&years([2026, 1970], &mut row));
    assert!(message.contains("row 101") && message.contains("a clock that was reset"), "{message}");
    let (_, summary) = tracked_file(&years([1970, 2026], &mut row), &[]);
    assert!(has_hint(&summary, "row 101, of 2026-01-01T01:40:00"), "{summary}");
    let (_, summary) = tracked_file(&years([2026, 2026], &mut row), &[]);
    assert!(!has_hint(&summary, "days after the row above"), "{summary}");
}

/// Defect: values that are rounded repeat, and a limit among them was not seen; bands held down to a third of the rows.
#[test]
fn limits_of_rounded_values_are_found() {
    let mut numbers = Numbers(705);
    let (mut levels, mut table) = (Vec::new(), "time,rh1,rh2\n".to_owned());
    for k in 0..800 {
        let level = 97.0 + 4.0 * (f64::from(k) / 60.0).sin();
        levels.push(level);
        let cells = [(); 2].map(|()| (level + 1.5 * numbers.normal()).min(100.0));
        table += &format!("{k},{:.1},{:.1}\n", cells[0], cells[1]);
    }
    let (rows, summary) = tracked_file(&table, &[]);
    assert!(has_hint(&summary, "as --limits ..100 says"), "{summary}");
    let found = share(&rows, &levels);
    assert!(found > 0.92, "{found}");
    // A level that rests at its highest value has values on both sides of it.
    let mut resting = "time,a\n".to_owned();
    for k in 0..800 {
        let level: f64 = if k % 100 < 50 {
            30.0
        } else {
            30.0 - 0.1 * f64::from(k % 50)
        };
        resting += &format!("{k},{:.1}\n", level + 0.04 * numbers.normal());
    }
    let (_, summary) = tracked_file(&resting, &[]);
    assert!(!has_hint(&summary, "detection limit"), "{summary}");
}

/// Defect: cells below a limit were told to be a stuck sensor, or one whose noise changes.
#[test]
fn cells_that_are_limits_are_no_stuck_sensor() {
    let mut numbers = Numbers(706);
    let mut table = "time,lead\n".to_owned();
    for k in 0..400 {
        let value = (if k < 200 { 2.0 } else { 0.2 }) + 0.1 * numbers.normal();
        table += &if value < 0.5 {
            format!("{k},<0.5\n")
        } else {
            format!("{k},{value:.3}\n")
        };
    }
    let (_, summary) = tracked_file(&table, &[]);
    assert!(!has_hint(&summary, "values in a row") && !has_hint(&summary, "grows"), "{summary}");
}

/// Defect: what a stuck sensor repeats was taken for a small noise of its own, and for an error of all that lasts.
#[test]
fn a_stuck_sensor_has_no_other_noise() {
    let mut numbers = Numbers(707);
    let levels = walk(&mut numbers, 600, 0.1);
    let (mut one, mut two, mut last) = ("time,a\n".to_owned(), "time,a,b\n".to_owned(), 0.0);
    for (k, level) in levels.iter().enumerate() {
        if !(300..400).contains(&k) {
            last = level + 0.3 * numbers.normal();
        }
        one += &format!("{k},{last:.4}\n");
        two += &format!("{k},{last:.4},{:.4}\n", level + 0.3 * numbers.normal());
    }
    let (_, summary) = tracked_file(&one, &[]);
    assert!(has_hint(&summary, "it may be stuck") && !has_hint(&summary, "its noise changes"), "{summary}");
    let (rows, summary) = tracked_file(&two, &[]);
    assert!(!has_hint(&summary, "errors last"), "{summary}");
    let found = share(&rows, &levels);
    assert!(found > 0.9, "{found}");
}

/// Defect: three rows behind a jump were outside of their bands.
#[test]
fn bands_hold_a_jump_from_its_second_value_on() {
    let mut numbers = Numbers(708);
    let (mut table, mut levels, mut jumps) = ("time,a\n".to_owned(), Vec::new(), Vec::new());
    let mut level = 20.0;
    for k in 0..600 {
        if k > 200 && k % 50 == 0 {
            level += if numbers.normal() > 0.0 { 8.0 } else { -8.0 };
            jumps.push(k);
        }
        levels.push(level);
        table += &format!("{k},{:.4}\n", level + 0.3 * numbers.normal());
    }
    let (rows, summary) = tracked_file(&table, &[]);
    let behind = jumps.iter().flat_map(|k| [k + 1, k + 2]);
    let lost = behind.filter(|k| !held(&rows[*k], levels[*k])).count();
    assert!(lost <= 1, "{lost} of {} rows", 2 * jumps.len());
    let events = summary["events"].as_array().unwrap();
    let reopened = events.iter().filter(|event| event["event"] == "reopened").count();
    assert_eq!(reopened, jumps.len(), "{summary}");
    // The words for people.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("t.csv"), &table).unwrap();
    let output = fewbits(folder.path(), &["track", "t.csv"], b"");
    assert!(
        output.status.success() && !text(&output.stderr).contains("noise is larger"),
        "{}",
        text(&output.stderr)
    );
}

/// Defect: of counts of about two, bands of roots held .85 of the rows without a word.
#[test]
fn roots_of_small_counts_are_told() {
    let mut numbers = Numbers(709);
    let mut table = |mean: f64| {
        let mut table = "time,counts\n".to_owned();
        for k in 0..300 {
            // Counts of a mean: arrivals within a time of it.
            let (mut time, mut count) = (-numbers.uniform().ln(), 0);
            while time < mean {
                time -= numbers.uniform().ln();
                count += 1;
            }
            table += &format!("{k},{count}\n");
        }
        table
    };
    let (_, low) = tracked_file(&table(2.0), &["--transform", "root"]);
    let (_, high) = tracked_file(&table(12.0), &["--transform", "root"]);
    let told = [low, high].map(|summary| has_hint(&summary, "most counts are below 4"));
    assert_eq!(told, [true, false]);
}
