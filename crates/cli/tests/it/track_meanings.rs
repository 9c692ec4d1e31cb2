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
    let (without, wide) = against(&table, &truth, &known);
    assert!(error < 1.02 * without && wide > held, "{error} {without} {wide} {held}");
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

/// The summary of a run.
fn summary(table: &str, options: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let words = [&["track", "-", "-o", "x.csv"], options].concat();
    text(&crate::fewbits(folder.path(), &words, table.as_bytes()).stderr)
}

/// A thermometer that sends on change.
fn on_change(seed: u64) -> (String, Vec<f64>) {
    let mut numbers = Numbers(seed);
    let truth = walk(&mut numbers, 2000, 20.0, 0.05);
    let (mut table, mut last) = ("time,temp\n".to_owned(), None);
    for (row, level) in truth.iter().enumerate() {
        let value = level + 0.05 * numbers.normal();
        let is_sent = last.is_none_or(|last: f64| (value - last).abs() >= 0.5);
        if is_sent {
            last = Some(value);
            table += &format!("{},{value:.2}\n", 60 * row);
        } else {
            table += &format!("{},\n", 60 * row);
        }
    }
    (table, truth)
}

/// With the width said, noise and change are found from silence too; without it the summary says so. A Gaussian belief within a cell of ten
/// deviations is an approximation: its bands of 95 % hold less.
#[test]
fn values_that_come_on_change() {
    let (mut errors, mut shares) = (0.0, 0.0);
    for seed in 5..11 {
        let (table, truth) = on_change(seed);
        let (error, held) = against(&table, &truth, &["--silent-within", "0.5"]);
        println!("{seed}: {error} {held}");
        errors += error / 6.0;
        shares += held / 6.0;
    }
    assert!(errors < 0.23 && shares > 0.8, "{errors} {shares}");
    let (table, _) = on_change(5);
    assert!(summary(&table, &[]).contains("--silent-within 0.5"));
    assert!(!summary(&table, &["--silent-within", "0.5"]).contains("if it sends on change"));
}

/// Defect: accuracies of rows were taken for noise when change was found, and a row of another accuracy than usual raised alarms.
#[test]
fn accuracies_of_rows_raise_no_alarm() {
    let mut numbers = Numbers(6);
    let truth = walk(&mut numbers, 800, 0.0, 0.3);
    let mut table = "x,sd\n".to_owned();
    for (row, level) in truth.iter().enumerate() {
        let deviation = [0.3, 1.0, 5.0][row * 7 % 3];
        table += &format!("{:.3},{deviation}\n", level + deviation * numbers.normal());
    }
    for options in [
        &["--accuracy-column", "sd"][..],
        &[
            "--accuracy-column",
            "sd",
            "--noise",
            "1",
            "--change",
            "0.3/1s",
            "--prior",
            "0±1",
        ],
    ] {
        let (error, held) = against(&table, &truth, options);
        assert!(error < 0.55 && held > 0.91, "{options:?}: {error} {held}");
        assert!(!summary(&table, options).contains("lost"), "{options:?}");
    }
}

/// Two values only, 0 and then 100: no step of rounding is 100 wide.
#[test]
fn two_values_are_no_step_of_rounding() {
    let table = "pot\n".to_owned() + &"0\n".repeat(20) + &"100\n".repeat(60);
    let truth: Vec<f64> = (0..80).map(|row| if row < 20 { 0.0 } else { 100.0 }).collect();
    let folder = tempfile::tempdir().unwrap();
    let out = text(&good(folder.path(), &["track", "-", "--json"], table.as_bytes()));
    let last: serde_json::Value = serde_json::from_str(out.lines().last().unwrap()).unwrap();
    let of = |name: &str| last[name].as_f64().unwrap();
    assert!((of("level") - truth[79]).abs() < 1.0 && of("level_high") - of("level_low") < 3.0, "{last}");
}

/// A ramp that rises by 10 000 in a second, in noise of 1, 10 000 readings a second: the slope's prior comes from the first rows.
#[test]
fn a_steep_slope_is_followed_from_the_first_rows() {
    let mut numbers = Numbers(7);
    let mut table = "time,z\n".to_owned();
    let truth: Vec<f64> = (0..400).map(f64::from).collect();
    for (row, level) in truth.iter().enumerate() {
        table += &format!("{:.4},{:.4}\n", row as f64 * 1e-4, level + numbers.normal());
    }
    let (error, held) = against(&table, &truth, &["--model", "velocity"]);
    assert!(error < 0.5 && held > 0.9, "{error} {held}");
}

#[test]
fn hints_name_what_no_option_says() {
    let mut numbers = Numbers(8);
    let mut headings = "heading\n".to_owned();
    for level in walk(&mut numbers, 300, 0.0, 0.3) {
        headings += &format!("{:.1}\n", (level + 5.0 * numbers.normal()).rem_euclid(360.0));
    }
    assert!(summary(&headings, &[]).contains("--period 360"));
    assert!(!summary(&headings, &["--period", "360"]).contains("--period 360"));
    let mut two = "a,b\n".to_owned();
    for level in walk(&mut numbers, 300, 0.0, 0.1) {
        two += &format!("{:.3},{:.3}\n", level + 0.5 * numbers.normal(), level + 2.0 + 0.5 * numbers.normal());
    }
    assert!(summary(&two, &["--align", "200"]).contains("nothing says which is right"));
}

/// Times of day without a date give the estimates of dates: a row behind midnight was refused as one of the past.
#[test]
fn times_of_day_pass_midnight() {
    let mut numbers = Numbers(77);
    let truth = walk(&mut numbers, 200, 20.0, 0.1);
    let values: Vec<String> = truth
        .iter()
        .map(|level| format!("{:.3}", level + 0.3 * numbers.normal()))
        .collect();
    // A row each quarter of an hour, and two midnights.
    let table = |date: fn(usize) -> String| {
        let clock = |row: usize| format!("{}{:02}:{:02}:00", date(row / 96), row % 96 / 4, row % 4 * 15);
        let rows = values
            .iter()
            .enumerate()
            .map(|(row, value)| format!("{},{value}\n", clock(row)));
        rows.fold("time,x\n".to_owned(), |text, row| text + &row)
    };
    let folder = tempfile::tempdir().unwrap();
    let levels = |table: String, options: &[&str]| {
        let words = [&["track", "-", "--json"], options].concat();
        let out = text(&good(folder.path(), &words, table.as_bytes()));
        let rows = out
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        rows.map(|row| ["level", "level_low", "level_high"].map(|name| row[name].as_f64().unwrap()))
            .collect::<Vec<_>>()
    };
    let dated = levels(table(|day| format!("2026-03-0{} ", day + 1)), &[]);
    assert_eq!(dated.len(), 200);
    assert_eq!(levels(table(|_| String::new()), &[]), dated);
    // Rows that change places at midnight stay in their day.
    let swapped = |table: String| {
        let mut lines: Vec<&str> = table.lines().collect();
        lines.swap(96, 97);
        lines.join("\n") + "\n"
    };
    let late = &["--late", "1h"];
    assert_eq!(
        levels(swapped(table(|_| String::new())), late),
        levels(swapped(table(|day| format!("2026-03-0{} ", day + 1))), late)
    );
}
