//! `fewbits track` where a row says more than a number: thresholds, accuracies, rounding, silence, limits; and smoothing.

use crate::numbers::Numbers;
use crate::{good, text};

fn walk(numbers: &mut Numbers, rows: usize, start: f64, change: f64) -> Vec<f64> {
    let mut level = start;
    let step = |_| {
        level += change * numbers.normal();
        level
    };
    (0..rows).map(step).collect()
}

/// Root mean square error, and share of the truth in the band.
fn against(table: &str, truth: &[f64], options: &[&str]) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let words = [&["track", "-", "--json"], options].concat();
    let out = text(&good(folder.path(), &words, table.as_bytes()));
    let rows: Vec<serde_json::Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(rows.len(), truth.len());
    let of = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    let squares: f64 = rows
        .iter()
        .zip(truth)
        .map(|(row, truth)| (of(row, "level") - truth).powi(2))
        .sum();
    let held = rows
        .iter()
        .zip(truth)
        .filter(|(row, truth)| of(row, "level_low") <= **truth && **truth <= of(row, "level_high"));
    let count = truth.len() as f64;
    ((squares / count).sqrt(), held.count() as f64 / count)
}

#[test]
fn bits_with_a_threshold_in_each_row() {
    let mut numbers = Numbers(1);
    let truth = walk(&mut numbers, 1500, 0.0, 0.02);
    let mut table = "bit,edge\n".to_owned();
    for (row, level) in truth.iter().enumerate() {
        let edge = ((row * 7) % 33) as f64 / 16.0 - 1.0;
        table += &format!("{},{edge}\n", u8::from(level + 0.3 * numbers.normal() >= edge));
    }
    let options = [
        "--reports",
        "--send",
        "bit",
        "--threshold-column",
        "edge",
        "--noise",
        "0.3",
        "--change",
        "0.02",
        "--prior",
        "0±0.5",
    ];
    let (error, held) = against(&table, &truth, &options);
    assert!(error < 0.14 && held > 0.9, "{error} {held}");
}

#[test]
fn each_row_has_its_own_accuracy() {
    let mut numbers = Numbers(2);
    let truth = walk(&mut numbers, 800, 50.0, 0.3);
    let (mut table, mut belief, mut squares) = ("fix,sd\n".to_owned(), (50.0, 25.0), 0.0);
    for level in &truth {
        let deviation = if numbers.uniform() < 0.3 { 0.4 } else { 6.0 };
        let value = level + deviation * numbers.normal();
        table += &format!("{value},{deviation}\n");
        // The Kalman filter that knows.
        let (mean, variance): (f64, f64) = (belief.0, belief.1 + 0.09);
        let gain = variance / (variance + deviation * deviation);
        belief = (mean + gain * (value - mean), (1.0 - gain) * variance);
        squares += (belief.0 - level).powi(2);
    }
    let best = (squares / 800.0).sqrt();
    let options = [
        "--accuracy-column",
        "sd",
        "--noise",
        "6",
        "--change",
        "0.3",
        "--prior",
        "50±5",
    ];
    let (error, held) = against(&table, &truth, &options);
    assert!(error < 1.02 * best && (0.92..=0.98).contains(&held), "{error} {best} {held}");
}

/// Whole degrees of a slow room: what is read is a cell.
#[test]
fn rounded_readings_are_cells() {
    let mut numbers = Numbers(3);
    let truth: Vec<f64> = (0..1400).map(|row| 21.0 + 2.3 * (row as f64 / 210.0).sin()).collect();
    let mut table = "temp\n".to_owned();
    for level in &truth {
        table += &format!("{}\n", (level + 0.15 * numbers.normal()).round());
    }
    for options in [&[][..], &["--noise", "0.15"]] {
        let (error, held) = against(&table, &truth, options);
        assert!(error < 0.2 && held > 0.9, "{options:?}: {error} {held}");
    }
}

/// A thermometer that writes only when it has moved by half a degree. The level is a walk as the filter supposes.
#[test]
fn silence_of_a_sensor_that_sends_on_change_says_something() {
    let mut numbers = Numbers(4);
    let truth = walk(&mut numbers, 1400, 20.0, 0.06);
    let (mut table, mut last, mut squares) = ("temp\n".to_owned(), f64::NAN, 0.0);
    for level in &truth {
        let value: f64 = level + 0.05 * numbers.normal();
        if (value - last).abs() < 0.5 {
            table += "\"\"\n";
        } else {
            last = value;
            table += &format!("{value}\n");
        }
        squares += (last - level).powi(2);
    }
    let known = ["--noise", "0.05", "--change", "0.06", "--prior", "20±2"];
    let (error, held) = against(&table, &truth, &[&["--silent-within", "0.5"][..], &known].concat());
    let last_value = (squares / 1400.0).sqrt();
    assert!(error < 1.02 * last_value && (0.92..=0.98).contains(&held), "{error} {last_value} {held}");
    // Without it an empty cell says nothing, and the band grows.
    let (without, _) = against(&table, &truth, &known);
    assert!(error < without, "{error} {without}");
}

#[test]
fn values_at_a_detection_limit_are_half_lines() {
    let mut numbers = Numbers(5);
    let truth: Vec<f64> = walk(&mut numbers, 600, 0.5, 0.02);
    let mut table = "nitrate\n".to_owned();
    for level in &truth {
        table += &format!("{}\n", (level + 0.1 * numbers.normal()).max(0.45));
    }
    let known = [
        "--noise",
        "0.1",
        "--change",
        "0.02",
        "--prior",
        "0.5±0.2",
        "--rounded",
        "no",
    ];
    let (taken, _) = against(&table, &truth, &known);
    let (error, held) = against(&table, &truth, &[&known[..], &["--limits", "0.45.."]].concat());
    assert!(error < taken && held > 0.85, "{error} {taken} {held}");
}

#[test]
fn smoothing_knows_what_came_after() {
    let mut numbers = Numbers(6);
    let truth = walk(&mut numbers, 600, 5.0, 0.2);
    let mut table = "a\n".to_owned();
    truth
        .iter()
        .for_each(|level| table += &format!("{}\n", level + numbers.normal()));
    let known = ["--noise", "1", "--change", "0.2", "--prior", "5±1"];
    let (filtered, _) = against(&table, &truth, &known);
    let (all, held) = against(&table, &truth, &[&known[..], &["--smooth", "all"]].concat());
    let (lagged, _) = against(&table, &truth, &[&known[..], &["--smooth", "5s"]].concat());
    // In the steady state the variance of the smoother is about half of the filter's.
    assert!(all < 0.8 * filtered && all <= 1.02 * lagged && lagged < 0.9 * filtered, "{filtered} {lagged} {all}");
    assert!((0.92..=0.98).contains(&held), "{held}");
}
