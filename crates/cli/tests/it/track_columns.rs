//! `fewbits track` on tables of which some columns measure another level, none, or the level late, and on columns that qualify others.

use crate::numbers::Numbers;
use crate::track_bands::tracked_file;
use crate::track_found::{has_hint, held, tracked};
use crate::{fewbits, folder, refused, text};
use serde_json::Value;

const ROWS: usize = 600;

/// The cells of a row, by the level.
type Cells<'a> = &'a mut dyn FnMut(f64, &mut Numbers) -> String;

/// Levels of a walk about 20, and a table of what `cells` makes of each.
fn walk(
    seed: u64,
    change: f64,
    head: &str,
    mut cells: impl FnMut(&[f64], &mut Numbers) -> String,
) -> (String, Vec<f64>) {
    let (mut numbers, mut levels, mut level) = (Numbers(seed), Vec::new(), 20.0);
    let mut table = format!("time,{head}\n");
    for row in 0..ROWS {
        level += change * numbers.normal();
        levels.push(level);
        table += &format!("{row},{}\n", cells(&levels, &mut numbers));
    }
    (table, levels)
}

fn share(rows: &[Value], levels: &[f64]) -> f64 {
    let held = rows.iter().zip(levels).filter(|(row, level)| held(row, **level));
    held.count() as f64 / levels.len() as f64
}

/// Defect: the columns of accuracies were taken for sensors, and bands held no row.
#[test]
fn accuracies_of_each_sensor_are_used() {
    let (table, levels) = walk(111, 0.1, "a,a_std,b,b_std,c", |levels, numbers| {
        let level = levels[levels.len() - 1];
        let deviations = [
            0.1 * (3.4 * numbers.uniform()).exp(),
            0.1 * (3.4 * numbers.uniform()).exp(),
        ];
        let values = deviations.map(|deviation| level + deviation * numbers.normal());
        let other = level + 0.5 * numbers.normal();
        format!("{:.4},{:.3},{:.4},{:.3},{other:.4}", values[0], deviations[0], values[1], deviations[1])
    });
    let (rows, summary) = tracked_file(&table, &[]);
    assert!(has_hint(&summary, "a_std is taken for the accuracy of the values of a"), "{summary}");
    let names: Vec<&str> = summary["sensors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["a", "b", "c"]);
    let found = summary["sensors"][2]["noise"].as_f64().unwrap();
    assert!((0.42..0.6).contains(&found), "{found}");
    let share = share(&rows, &levels);
    assert!((0.92..0.98).contains(&share), "{share}");
}

/// Defect: a sensor that is dead from the first row on moved the level: bands held .0 to .9 of the rows.
#[test]
fn columns_that_never_vary_are_no_sensors() {
    for dead in ["0", "21.5"] {
        let (table, levels) = walk(112, 0.1, "a,dead,b", |levels, numbers| {
            let level = levels[levels.len() - 1] - 19.5;
            let values = [0.3, 0.3].map(|noise| level + noise * numbers.normal());
            // It wakes up in row 500, as good as the others.
            let woken = if levels.len() > 500 {
                format!("{:.4}", level + 0.3 * numbers.normal())
            } else {
                dead.to_owned()
            };
            format!("{:.4},{woken},{:.4}", values[0], values[1])
        });
        let levels: Vec<f64> = levels.iter().map(|level| level - 19.5).collect();
        for (rows, summary) in [tracked_file(&table, &[]), tracked(&table, &[])] {
            assert!(has_hint(&summary, "while others vary"), "{summary}");
            assert_eq!(summary["sensors"][1]["reports"], 100);
            let share = share(&rows, &levels);
            assert!((0.91..0.985).contains(&share), "{dead}: {share}");
        }
    }
}

/// Defect: a mean beside its sensors, and a filtered column beside the raw one, were taken for measurements: bands held .06 of the rows.
#[test]
fn columns_that_follow_from_others_are_left_out() {
    let mut filtered = 20.0;
    let kinds: [(&str, Cells<'_>); 3] = [
        ("a,mean,b", &mut |level, numbers| {
            let [a, b] = [0.3, 0.3].map(|noise| level + noise * numbers.normal());
            format!("{a:.4},{:.4},{b:.4}", 0.5 * (a + b))
        }),
        ("raw,smooth", &mut |level, numbers| {
            let raw = level + 0.3 * numbers.normal();
            filtered += 0.3 * (raw - filtered);
            format!("{raw:.4},{filtered:.4}")
        }),
        ("celsius,fahrenheit", &mut |level, numbers| {
            let value = level + 0.3 * numbers.normal();
            format!("{value:.4},{:.4}", 32.0 + 1.8 * value)
        }),
    ];
    for (seed, (head, cells)) in kinds.into_iter().enumerate() {
        let (table, levels) =
            walk(120 + seed as u64, 0.1, head, |levels, numbers| cells(levels[levels.len() - 1], numbers));
        let (rows, summary) = tracked_file(&table, &[]);
        let left_out = head.split(',').nth(1).unwrap();
        assert!(has_hint(&summary, &format!("{left_out} follows from")), "{summary}");
        let share = share(&rows, &levels);
        assert!((0.92..0.98).contains(&share), "{head}: {share}");
    }
    // Sensors of small noise follow from nothing.
    let (table, _) = walk(124, 1.0, "a,b,c", |levels, numbers| {
        let level = levels[levels.len() - 1];
        [0.01, 0.01, 0.01]
            .map(|noise| format!("{:.3}", level + noise * numbers.normal()))
            .join(",")
    });
    let (_, summary) = tracked_file(&table, &[]);
    assert!(!has_hint(&summary, "follows from"), "{summary}");
}

/// Two places were told as offsets.
#[test]
fn groups_of_different_levels_are_told() {
    let mut other = 17.0;
    let (table, _) = walk(113, 0.1, "a,b,\"far, c\",d", |levels, numbers| {
        other += 0.1 * numbers.normal();
        let level = levels[levels.len() - 1];
        let cells = [level, level, other, other].map(|level| format!("{:.4}", level + 0.3 * numbers.normal()));
        cells.join(",")
    });
    let (_, summary) = tracked_file(&table, &[]);
    assert!(has_hint(&summary, "a, b agree with each other, and so do far, c, d agree"), "{summary}");
    // One level, offsets that stay, and noises of all sizes.
    let (table, _) = walk(114, 0.1, "a,b,c,d", |levels, numbers| {
        let level = levels[levels.len() - 1];
        let cells = [(0.1, 0.0), (0.3, 3.0), (1.0, 0.0), (2.0, -3.0)];
        cells
            .map(|(noise, offset)| format!("{:.4}", level + offset + noise * numbers.normal()))
            .join(",")
    });
    let (_, summary) = tracked_file(&table, &[]);
    assert!(!has_hint(&summary, "agree with each other"), "{summary}");
}

/// A sensor that lags drew the level to where it was, and nothing was said.
#[test]
fn a_late_sensor_is_told() {
    let table = |seed: u64, late: usize| {
        let cells = |levels: &[f64], numbers: &mut Numbers| {
            let now = levels.len() - 1;
            let levels = [levels[now.saturating_sub(late)], levels[now], levels[now]];
            levels
                .map(|level| format!("{:.4}", level + 0.3 * numbers.normal()))
                .join(",")
        };
        walk(seed, 0.2, "slow,b,c", cells).0
    };
    for seed in 115..118 {
        let (_, summary) = tracked_file(&table(seed, 4), &[]);
        assert!(has_hint(&summary, "slow says late what the others say"), "{summary}");
        assert!(!has_hint(&summary, "b says late") && !has_hint(&summary, "c says late"), "{summary}");
        let (_, summary) = tracked_file(&table(seed, 0), &[]);
        assert!(!has_hint(&summary, "says late"), "{summary}");
    }
}

/// Defect: `--late 3000s` was proposed, which mixes the hours.
#[test]
fn a_clock_that_is_set_back_in_autumn_is_told() {
    let (_folder, path) = folder();
    let mut table = "time,a\n".to_owned();
    for (hour, minute) in [
        (1, 40),
        (1, 50),
        (2, 0),
        (2, 10),
        (2, 20),
        (2, 30),
        (2, 40),
        (2, 50),
        (2, 0),
        (2, 10),
    ] {
        table += &format!("2026-10-25 {hour:02}:{minute:02}:00,20.5\n");
    }
    let message = refused(&path, &["track", "-"], table.as_bytes());
    assert!(message.contains("set back by an hour") && message.contains("difference from UTC"), "{message}");
    // Another step back stays one.
    let message = refused(&path, &["track", "-"], table.replace("02:50", "02:25").as_bytes());
    assert!(message.contains("--late"), "{message}");
}

/// Defect: whole degrees that rest for the first 200 rows were refused.
#[test]
fn values_that_are_equal_at_first_are_waited_for() {
    let (table, levels) = walk(118, 0.02, "a", |levels, numbers| {
        let level = if levels.len() < 260 {
            20.0
        } else {
            levels[levels.len() - 1]
        };
        format!("{:.0}", level + 0.1 * numbers.normal())
    });
    for (rows, _) in [tracked_file(&table, &[]), tracked(&table, &[])] {
        assert_eq!(rows.len(), levels.len());
    }
}

/// Defect: a column that says whether a pump runs was a sensor of the level: of 6 tables of a fridge and its compressor bands held .64, in one no row.
#[test]
fn a_state_beside_values_elsewhere_is_left_out() {
    let (table, levels) = walk(119, 0.1, "temperature,pump", |levels, numbers| {
        let level = levels[levels.len() - 1];
        format!("{:.3},{}", level + 0.2 * numbers.normal(), levels.len() / 7 % 2)
    });
    let (rows, summary) = tracked_file(&table, &[]);
    assert!(has_hint(&summary, "pump is 0 or 1, while others are elsewhere"), "{summary}");
    assert!(share(&rows, &levels) > 0.9);
    assert_eq!(summary["sensors"][1]["reports"], 0);
    // A level near them may be rounded to them.
    let (table, _) = walk(120, 0.1, "a,b", |levels, numbers| {
        let level = 0.5 + 0.05 * (levels[levels.len() - 1] - 20.0);
        let coarse = f64::from(u8::from(level + 0.4 * numbers.normal() > 0.5));
        format!("{:.3},{coarse}", level + 0.2 * numbers.normal())
    });
    assert!(!has_hint(&tracked_file(&table, &[]).1, "taken for a state"));
}

/// Defect: the strength of a radio beside the weight of a hive was a sensor of it (bands held .41 in one of 6 tables), as were the least and the greatest
/// value of an interval beside its mean (.88).
#[test]
fn columns_that_say_something_else_are_named() {
    let (_folder, path) = folder();
    let problem = |head: &str| {
        let columns = head.split(',').count();
        let line = |row: usize| {
            let cells: Vec<String> = (1..columns).map(|one| (row * one % 7).to_string()).collect();
            format!("{row},{}\n", cells.join(","))
        };
        let rows: String = (0..40).map(line).collect();
        let output = fewbits(&path, &["track", "-"], format!("{head}\n{rows}").as_bytes());
        text(&output.stderr).to_owned()
    };
    let without = |head: &str, those: &str| {
        let problem = problem(head);
        assert!(problem.contains("not measure the level: say --without") && problem.contains(those), "{problem}");
    };
    without("time,weight_kg,rssi", "--without rssi");
    without("time,north,south,Battery (V)", "--without 'Battery (V)'");
    without("time,phone,phone_sats,setpoint", "--without phone_sats,setpoint");
    without("time,t_min,t_mean,t_max", "--without t_min,t_max");
    without("time,RECORD,value,status", "--without RECORD,status");
    for head in [
        "time,battery_1,battery_2",
        "time,min,max",
        "time,battery_temp,air_temp",
        "time,rssi_a,rssi_b",
    ] {
        let problem = problem(head);
        assert!(!problem.contains("not measure"), "{head}: {problem}");
    }
}

/// Defect: of a value and its change from row to row the value was left out: bands held no row.
#[test]
fn the_change_of_a_column_is_left_out() {
    let mut last = None;
    let (table, levels) = walk(121, 0.3, "value,delta", |levels, numbers| {
        let value = (100.0 * (levels[levels.len() - 1] + 0.2 * numbers.normal())).round() / 100.0;
        let change = value - last.replace(value).unwrap_or(value);
        format!("{value:.2},{change:.2}")
    });
    let (rows, summary) = tracked_file(&table, &[]);
    assert!(has_hint(&summary, "delta is the change from row to row of value"), "{summary}");
    assert!(share(&rows, &levels) > 0.9);
}
