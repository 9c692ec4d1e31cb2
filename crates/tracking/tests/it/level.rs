//! A level.

use crate::{Normal, rows, stated, tracked, walk};
use fewbits_tracking::{
    Error, Failure, Instant, Instants, LevelOptions, LevelTracker, PerSensor, Qualifier, Report, Rows,
};

const CHANGE: f64 = 0.1;

fn two_sensors(count: usize) -> (Vec<f64>, Vec<Instant>) {
    let mut normal = Normal(1);
    let level = walk(&mut normal, count, CHANGE);
    let mut noise = |deviation: f64| deviation * normal.next();
    let cells: Vec<_> = level
        .iter()
        .enumerate()
        .map(|(k, level)| vec![Some(level + noise(0.3)), (k % 5 != 3).then(|| level + noise(0.6))])
        .collect();
    (level, rows(cells))
}

#[test]
fn stated_numbers_give_the_kalman_filter() {
    let (_, table) = two_sensors(400);
    let noises = [0.3, 0.6];
    let options = LevelOptions {
        noise: PerSensor {
            named: vec![("b".to_owned(), Some(noises[1]))],
            others: Some(noises[0]),
        },
        ..stated(noises[0], CHANGE)
    };
    let (found, summary) = tracked(&options, Instants::listed(["a", "b"], table.clone()));
    let (mut mean, mut variance) = (20.0_f64, 9.0_f64);
    for (k, (row, found)) in table.iter().zip(&found).enumerate() {
        variance += if k == 0 { 0.0 } else { CHANGE * CHANGE };
        for ((_, cell), noise) in row.reports.iter().zip(noises) {
            if let Some(value) = cell {
                let gain = variance / (variance + noise * noise);
                mean += gain * (value - mean);
                variance *= 1.0 - gain;
            }
        }
        let (level, deviation) = found.estimate[0];
        assert!((level - mean).abs() < 1e-9 && (deviation - variance.sqrt()).abs() < 1e-9, "row {k}");
    }
    assert_eq!((summary.rows, summary.reports, summary.sensors[1].gaps), (400, 720, 80));
}

#[test]
fn unstated_noises_are_found() {
    let (level, table) = two_sensors(1500);
    let (found, summary) = tracked(&LevelOptions::default(), Instants::listed(["a", "b"], table));
    for (sensor, noise) in summary.sensors.iter().zip([0.3, 0.6]) {
        assert!((sensor.noise / noise - 1.0).abs() < 0.15, "{}: {}", sensor.name, sensor.noise);
    }
    let held = found.iter().zip(&level).filter(|(row, level)| {
        let (mean, deviation) = row.estimate[0];
        (mean - **level).abs() < 1.96 * deviation
    });
    let share = held.count() as f64 / level.len() as f64;
    assert!((0.92..0.98).contains(&share), "bands of 95 % held {share}");
}

#[test]
fn dead_sensor_is_named() {
    let (_, mut table) = two_sensors(600);
    table[300..].iter_mut().for_each(|row| row.reports[0].1 = None);
    let (_, summary) = tracked(&LevelOptions::default(), Instants::listed(["a", "b"], table));
    assert!(!summary.sensors[0].used && summary.sensors[1].used);
    assert!(summary.events.iter().any(|event| event.sensor.as_deref() == Some("a")));
    assert!(
        summary
            .lines()
            .contains(&"a is not used any more: it is silent".to_owned()),
        "{:?}",
        summary.lines()
    );
}

/// Bits against fixed thresholds, by a grid of the level written out here.
#[test]
fn bits_give_the_exact_posterior() {
    let mut normal = Normal(3);
    let (noise, thresholds) = (0.5, [19.5, 20.5]);
    let level = walk(&mut normal, 300, CHANGE);
    let mut bit = |level: f64, threshold: f64| Some(f64::from(u8::from(level + noise * normal.next() > threshold)));
    let table = rows(
        level
            .iter()
            .map(|level| thresholds.map(|threshold| bit(*level, threshold)).to_vec()),
    );
    let named = ["a", "b"].map(str::to_owned).into_iter().zip(thresholds.map(Some));
    let options = LevelOptions {
        send: PerSensor::all(Report::Sign),
        reports: true,
        threshold: PerSensor {
            named: named.collect(),
            others: None,
        },
        ..stated(noise, CHANGE)
    };
    let (found, _) = tracked(&options, Instants::listed(["a", "b"], table.clone()));

    let (step, count) = (0.02, 1500);
    let nodes: Vec<f64> = (0..count).map(|i| 5.0 + step * f64::from(i)).collect();
    let normal = |x: f64| (-0.5 * x * x).exp();
    // The normal distribution function, by Simpson's rule.
    let cumulative = |x: f64| {
        let (n, x) = (40, x.clamp(-8.0, 8.0));
        let h = x / f64::from(n);
        let sum: f64 = (0..=n)
            .map(|i| if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) } * normal(h * f64::from(i)))
            .sum();
        0.5 + sum * h / 3.0 / (2.0 * std::f64::consts::PI).sqrt()
    };
    let reach = (6.0 * CHANGE / step) as usize;
    let kernel: Vec<f64> = (0..=2 * reach)
        .map(|i| normal((i as f64 - reach as f64) * step / CHANGE))
        .collect();
    let mut belief: Vec<f64> = nodes.iter().map(|x| normal((x - 20.0) / 3.0)).collect();
    for (k, (row, found)) in table.iter().zip(&found).enumerate() {
        if k > 0 {
            let before = belief.clone();
            for (i, p) in belief.iter_mut().enumerate() {
                let near = i.saturating_sub(reach)..(i + reach + 1).min(nodes.len());
                *p = near.map(|j| before[j] * kernel[j + reach - i]).sum();
            }
        }
        for ((_, cell), threshold) in row.reports.iter().zip(thresholds) {
            let sign = if *cell == Some(1.0) { 1.0 } else { -1.0 };
            for (p, x) in belief.iter_mut().zip(&nodes) {
                *p *= cumulative(sign * (x - threshold) / noise);
            }
        }
        let sum: f64 = belief.iter().sum();
        belief.iter_mut().for_each(|p| *p /= sum);
        let mean: f64 = belief.iter().zip(&nodes).map(|(p, x)| p * x).sum();
        let variance: f64 = belief.iter().zip(&nodes).map(|(p, x)| p * (x - mean).powi(2)).sum();
        let (level, deviation) = found.estimate[0];
        let off = ((level - mean) / variance.sqrt())
            .abs()
            .max((deviation / variance.sqrt() - 1.0).abs());
        assert!(off < 0.01, "row {k}: {level} +- {deviation}, exactly {mean} +- {}", variance.sqrt());
    }
}

#[test]
fn failed_step_leaves_the_tracker_as_it_was() {
    let mut table = two_sensors(300).1;
    for row in &mut table {
        row.reports[0].1 = row.reports[0].1.map(|value| f64::from(u8::from(value > 20.0)));
    }
    let options = LevelOptions {
        reports: true,
        send: PerSensor {
            named: vec![("a".to_owned(), Report::Sign)],
            others: Report::Value,
        },
        ..stated(0.5, CHANGE)
    };
    let names = ["a", "b"].map(str::to_owned);
    let mut lists = [0; 2].map(|_| Instants::listed(names.clone(), table.clone()));
    let [mut plain, mut tried] = lists.each_mut().map(|rows| LevelTracker::new(&options, rows).unwrap());
    for (k, row) in table.iter().enumerate() {
        if k % 7 == 2 {
            let no_bit = Instant::new(7, row.seconds, &[Some(0.5), Some(20.0)]);
            let of_none = Instant::new(7, row.seconds, &[Some(1.0), Some(20.0), Some(20.0)]);
            let before = Instant::new(7, row.seconds - 1.5, &[Some(1.0), Some(20.0)]);
            let never = Instant::new(7, f64::NAN, &[Some(1.0), Some(20.0)]);
            for wrong in [no_bit, of_none, before, never] {
                let error = tried.step(&names, &wrong).unwrap_err();
                assert!(matches!(error, Error::Row { row: 7, .. } | Error::Content { row: 7, .. }), "{error}");
            }
        }
        assert_eq!(plain.step(&names, row).unwrap(), tried.step(&names, row).unwrap(), "row {k}");
    }
    let [one, other] = &lists;
    assert_eq!(plain.finish(one), tried.finish(other));
}

/// A source that gives its rows one by one.
struct Live(std::vec::IntoIter<Instant>, [String; 2]);

impl Rows for Live {
    fn next(&mut self) -> Result<Option<Instant>, Failure> {
        Ok(self.0.next())
    }

    fn names(&self) -> &[String] {
        &self.1
    }

    fn is_live(&self) -> bool {
        true
    }
}

#[test]
fn rows_one_by_one_give_what_all_at_once_give() {
    let (_, table) = two_sensors(600);
    let options = LevelOptions {
        learning: None,
        ..stated(0.4, CHANGE)
    };
    let live = Live(table.clone().into_iter(), ["a", "b"].map(str::to_owned));
    let one_by_one = tracked(&options, Instants::new(live, Default::default()));
    let mut at_once = Instants::listed(["a", "b"], table);
    at_once.peek(usize::MAX).unwrap();
    let at_once = tracked(&options, at_once);
    for (k, (one, other)) in one_by_one.0.iter().zip(&at_once.0).enumerate() {
        assert_eq!(one, other, "row {k}");
    }
    assert_eq!(one_by_one.1.sensors, at_once.1.sensors);
}

#[test]
fn stated_accuracies_weigh_values() {
    let (_, mut table) = two_sensors(200);
    for (k, row) in table.iter_mut().enumerate() {
        row.reports.truncate(1);
        row.qualifiers = vec![Qualifier {
            accuracy: Some(if k % 2 == 0 { 0.3 } else { 1.2 }),
            ..Qualifier::default()
        }];
    }
    let options = LevelOptions {
        has_accuracies: true,
        ..stated(0.3, CHANGE)
    };
    let (found, _) = tracked(&options, Instants::listed(["a"], table.clone()));
    let (mut mean, mut variance) = (20.0_f64, 9.0_f64);
    for (k, (row, found)) in table.iter().zip(&found).enumerate() {
        variance += if k == 0 { 0.0 } else { CHANGE * CHANGE };
        let noise = row.qualifiers[0].accuracy.unwrap();
        let gain = variance / (variance + noise * noise);
        mean += gain * (row.reports[0].1.unwrap() - mean);
        variance *= 1.0 - gain;
        assert!((found.estimate[0].0 - mean).abs() < 1e-9, "row {k}");
    }
}

#[test]
fn numbers_out_of_range_name_their_field() {
    let refused = |options: LevelOptions| {
        let mut rows = Instants::listed(["a", "b"], two_sensors(50).1);
        match LevelTracker::new(&options, &mut rows).err().unwrap() {
            Error::Argument { argument, .. } => argument,
            error => panic!("{error}"),
        }
    };
    let good = || stated(0.3, CHANGE);
    let noise = PerSensor::all(Some(0.0));
    assert_eq!(refused(LevelOptions { noise, ..good() }), "noise");
    let change = Some((f64::NAN, 1.0));
    assert_eq!(refused(LevelOptions { change, ..good() }), "change");
    let prior = Some((f64::INFINITY, 1.0));
    assert_eq!(refused(LevelOptions { prior, ..good() }), "prior");
    let send = PerSensor::all(Report::Word { bits: 9 });
    assert_eq!(refused(LevelOptions { send, ..good() }), "send");
}

#[test]
fn no_rows_are_refused() {
    let mut rows = Instants::listed(["a"], Vec::new());
    let refused = LevelTracker::new(&LevelOptions::default(), &mut rows).err();
    assert!(matches!(refused, Some(Error::Empty)));
}

/// A level of which the slope wanders, by the Kalman filter that knows all numbers: the root of its mean squared error.
fn error_of_sloping(level: &[f64], table: &[Instant], noise: f64, change: f64) -> f64 {
    let (mut mean, mut covariance) = ([level[0], 0.0], [1.0, 0.0, 0.01]);
    let mut squares = 0.0;
    for (row, level) in table.iter().zip(level) {
        let [a, b, c] = covariance;
        let q = change * change;
        covariance = [a + 2.0 * b + c + q / 3.0, b + c + q / 2.0, c + q];
        mean[0] += mean[1];
        for (_, cell) in &row.reports {
            let [a, b, c] = covariance;
            let gain = [a / (a + noise * noise), b / (a + noise * noise)];
            let off = cell.unwrap() - mean[0];
            mean = [mean[0] + gain[0] * off, mean[1] + gain[1] * off];
            covariance = [a - gain[0] * a, b - gain[0] * b, c - gain[1] * b];
        }
        squares += (mean[0] - level).powi(2);
    }
    (squares / level.len() as f64).sqrt()
}

/// Defect: a slope was looked for in the first 200 rows only; errors were twice those of the right filter, and a right sensor was excluded.
#[test]
fn a_slope_that_later_rows_show_is_followed() {
    const SLOPE_CHANGE: f64 = 0.02;
    for seed in 0..8 {
        let mut normal = Normal(700 + seed);
        let (mut slope, mut now) = (0.0, 20.0);
        let mut next = |normal: &mut Normal| {
            slope += SLOPE_CHANGE * normal.next();
            now += slope;
            now
        };
        let level: Vec<f64> = (0..600).map(|_| next(&mut normal)).collect();
        let cells = level
            .iter()
            .map(|level| [(); 2].map(|()| Some(level + normal.next())).to_vec());
        let table = rows(cells.collect::<Vec<_>>());
        let best = error_of_sloping(&level, &table, 1.0, SLOPE_CHANGE);
        let (found, summary) = tracked(&LevelOptions::default(), Instants::listed(["a", "b"], table));
        let squares = found
            .iter()
            .zip(&level)
            .map(|(row, level)| (row.estimate[0].0 - level).powi(2));
        let error = (squares.sum::<f64>() / level.len() as f64).sqrt();
        assert!(error < 1.2 * best, "seed {seed}: {error} by {best}, {:?}", summary.hints);
        assert!(summary.sensors.iter().all(|sensor| sensor.used), "seed {seed}");
    }
}
