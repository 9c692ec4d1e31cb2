//! Calibration against the parameters that made the readings.

use crate::fit_worlds::{ROWS, exact, kinds, record, true_value, walk};
use fewbits_filters::calibration::{Instant, Reading};
use fewbits_filters::fit::{LevelModel, Quantity, Request, SensorModel, fit, fit_watched};
use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;

#[test]
fn parameters_are_found_within_their_errors() {
    for (name, truth, bits, request) in kinds() {
        let (mut within, mut all) = (0.0, 0.0_f64);
        for seed in 0..12 {
            let found = fit(&record(seed, &truth, &bits, ROWS), truth.sensors.len(), &request).unwrap();
            for one in &found.estimates {
                let off = (one.value - true_value(&truth, one.quantity)) / one.standard_error;
                within += f64::from(off.abs() < 2.0);
                all += 1.0;
            }
        }
        // 95 in a hundred, less four standard errors of so many.
        let least = 0.95 - 4.0 * (0.95 * 0.05 / all).sqrt();
        assert!(within >= least * all, "{name}: {within} of {all}");
    }
}

/// Defect: a fit had no more than the model that fits best, and its gain and offset lost 26 to 34 nats where the level left the range of the rows.
#[test]
fn a_forecast_allows_for_the_errors_of_the_parameters() {
    let (_, truth, _, request) = kinds().swap_remove(1);
    for seed in [1032, 1073, 1095] {
        let rows = record(seed, &truth, &[], 2 * ROWS);
        let found = fit(&rows[..ROWS], 2, &request).unwrap();
        let of = |model: &LevelModel| {
            model.log_likelihood(&rows).unwrap().0 - model.log_likelihood(&rows[..ROWS]).unwrap().0
        };
        let best = of(&truth);
        let (point, averaged) = (best - of(&found.model), best - found.log_predictive(&rows, ROWS).unwrap());

        assert!(point > 20.0 && averaged < 6.0, "{seed}: {point} {averaged}");
        // Mean and deviation of the sample are those that are stated.
        let sum: f64 = found.posterior.iter().map(|one| one.weight).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{seed}: {sum}");
        for one in found
            .estimates
            .iter()
            .filter(|one| matches!(one.quantity, Quantity::Gain(_) | Quantity::Change))
        {
            let mean = |of: &dyn Fn(f64) -> f64| {
                let values = found.posterior.iter();
                values
                    .map(|other| other.weight * of(true_value(&other.model, one.quantity)))
                    .sum::<f64>()
            };
            let middle = mean(&|value| value);
            let deviation = mean(&|value| (value - middle).powi(2)).sqrt();
            assert!((middle - one.value).abs() < 0.6 * one.standard_error, "{seed}: {one:?} {middle}");
            assert!((deviation / one.standard_error).ln().abs() < 0.3, "{seed}: {one:?} {deviation}");
        }
    }
}

/// A walk that is left out because the readings hardly show it, and one that is kept, both remain possible.
#[test]
fn a_walk_that_may_be_there_keeps_its_share() {
    let truth = walk(0.3, vec![exact(0.3), exact(0.5)]);
    let request = Request {
        reference: Some(0),
        walk: true,
        ..Request::default()
    };
    let mut shares = Vec::new();
    for seed in 0..10 {
        let found = fit(&record(seed, &truth, &[], ROWS), 2, &request).unwrap();
        let wanders = found.posterior.iter().filter(|one| one.model.sensors[1].walk > 0.0);
        shares.push(wanders.map(|one| one.weight).sum::<f64>());
        assert_eq!(found.model.sensors[1].walk > 0.0, shares[seed as usize] > 0.2, "{seed}: {shares:?}");
    }
    assert!(shares.iter().all(|share| (1e-3..0.9).contains(share)), "{shares:?}");
}

/// Defects: the climb began at one change and one delay, and ended at a kink 181 nats below the truth; a noise that the readings hardly tell from
/// zero ran to zero, and the climb ended on that flat 4 nats below it.
#[test]
fn no_climb_ends_below_the_truth() {
    for (kind, seeds) in [(3, [0, 74, 97]), (1, [33, 78, 88])] {
        let (name, truth, bits, request) = kinds().swap_remove(kind);
        for seed in seeds {
            let record = record(seed, &truth, &bits, ROWS);
            let found = fit(&record, truth.sensors.len(), &request).unwrap();
            let best = truth.log_likelihood(&record).unwrap().0;
            assert!(found.log_likelihood > best - 0.5, "{name} {seed}: {} for {best}", found.log_likelihood);
            assert!(found.model.sensors.iter().all(|sensor| sensor.noise > 0.02), "{name} {seed}: {found:?}");
        }
    }
}

/// Defect: a drift that the readings do not show was kept, and cost what it was extended by.
#[test]
fn a_drift_that_the_readings_do_not_show_is_refused() {
    let truth = walk(
        0.3,
        vec![
            exact(0.3),
            exact(0.5),
            SensorModel {
                slope: 0.02,
                ..exact(0.5)
            },
        ],
    );
    let request = Request {
        reference: Some(0),
        slope: true,
        ..Request::default()
    };
    let (mut kept, worlds) = (0, 20);
    for seed in 0..worlds {
        let found = fit(&record(seed, &truth, &[], ROWS), 3, &request).unwrap();
        kept += usize::from(found.estimates.iter().any(|one| one.quantity == Quantity::Slope(1)));
        assert!(found.estimates.iter().any(|one| one.quantity == Quantity::Slope(2)), "{seed}: {found:?}");
        assert!(found.model.sensors[1].slope == 0.0 || kept > 0);
    }
    // Two nats: one in twenty-two. Four of twenty are as many as come by chance once in a hundred.
    assert!(kept <= 4, "{kept} of {worlds}");
}

#[test]
fn what_cannot_be_told_is_refused() {
    // One sensor and no reference: its bias is that of the level.
    let alone = walk(
        0.3,
        vec![SensorModel {
            bias: 5.0,
            ..exact(0.5)
        }],
    );
    let request = Request {
        gain: true,
        slope: true,
        delay: true,
        walk: true,
        ..Request::default()
    };
    let found = fit(&record(1, &alone, &[], ROWS), 1, &request).unwrap();
    for quantity in [
        Quantity::Bias(0),
        Quantity::Gain(0),
        Quantity::Slope(0),
        Quantity::Walk(0),
        Quantity::Delay(0),
    ] {
        assert!(found.refused.iter().any(|one| one.quantity == quantity), "{quantity:?}: {found:?}");
        assert!(found.estimates.iter().all(|one| one.quantity != quantity), "{quantity:?}: {found:?}");
    }
    // Bits alone.
    let bits = walk(
        0.3,
        vec![
            SensorModel {
                bias: -20.0,
                ..exact(0.5)
            };
            2
        ],
    );
    let error = fit(&record(1, &bits, &[0, 1], ROWS), 2, &Request::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("bits alone leave unit and zero"), "{error}");
    // A threshold that the level never crosses.
    let far = walk(
        0.3,
        vec![
            exact(0.5),
            SensorModel {
                bias: -500.0,
                ..exact(0.5)
            },
        ],
    );
    let found = fit(&record(1, &far, &[1], ROWS), 2, &Request::default()).unwrap();
    assert!(found.refused.iter().any(|one| one.quantity == Quantity::Bias(1)), "{found:?}");
    // A level that wanders has no time constant.
    let found = fit(
        &record(1, &alone, &[], ROWS),
        1,
        &Request {
            time_constant: true,
            ..Request::default()
        },
    )
    .unwrap();
    assert!(found.model.time_constant.is_none_or(|seconds| seconds > 10.0), "{found:?}");
}

#[test]
fn shared_noise_is_seen_beside_a_reference() {
    let truth = walk(0.5, vec![exact(0.01), exact(1.0), exact(1.0)]);
    let mut rows = record(3, &truth, &[], 400);
    let mut rng = Stream::new(9).rng();
    for row in &mut rows {
        let common = rng.sample::<f64, _>(StandardNormal);
        for (_, reading) in &mut row.values[1..] {
            *reading = Reading::from(reading.value().unwrap() + common);
        }
    }
    let found = fit(
        &rows,
        3,
        &Request {
            reference: Some(0),
            ..Request::default()
        },
    )
    .unwrap();
    let one = found.correlations[0];
    assert!((one.value - 0.5).abs() < 4.0 * one.standard_error, "{one:?}");
}

/// Defect: what a reference's own noise brings into both sensors was taken for a correlation of theirs, 0.44 here for 0.
#[test]
fn the_noise_of_a_reference_is_no_correlation_of_others() {
    let delayed = SensorModel {
        delay: 1.5,
        gain: 1.4,
        ..exact(0.2)
    };
    for last in [exact(0.2), delayed] {
        let truth = walk(0.3, vec![exact(0.4), exact(0.5), last]);
        let request = Request {
            reference: Some(0),
            gain: true,
            delay: true,
            ..Request::default()
        };
        let found = fit(&record(4, &truth, &[], 800), 3, &request).unwrap();
        let one = found.correlations[0];
        assert!(one.value.abs() < 4.0 * one.standard_error && one.standard_error < 0.15, "{one:?}");
    }
}

/// Defects: a gain turned the readings about zero, so that the search for one about a level of a million ended at 1; a sensor that stands still, or
/// has few readings, held the level where it was first guessed to be.
#[test]
fn a_gain_far_from_zero_and_sensors_that_say_nothing() {
    let far = SensorModel {
        gain: 1.1,
        bias: 500.0,
        ..exact(0.4)
    };
    let truth = LevelModel {
        mean: 1e6,
        ..walk(0.3, vec![exact(0.3), far])
    };
    let request = Request {
        reference: Some(0),
        gain: true,
        ..Request::default()
    };
    let plain = record(6, &truth, &[], ROWS);
    let found = fit(&plain, 2, &request).unwrap();
    for one in &found.estimates {
        let off = (one.value - true_value(&truth, one.quantity)) / one.standard_error;
        assert!(off.abs() < 4.0, "{one:?}");
    }
    let mut more = plain.clone();
    for (row, instant) in more.iter_mut().enumerate() {
        instant.values.push((2, Reading::from(7.0)));
        if row < 5 {
            instant.values.push((3, Reading::from(row as f64)));
        }
    }
    let other = fit(&more, 4, &request).unwrap();
    assert_eq!((other.log_likelihood, &other.estimates), (found.log_likelihood, &found.estimates));
    assert_eq!(other.refused.len(), 2);
    // Nothing varies.
    let still: Vec<Instant> = (0..50)
        .map(|row| Instant {
            seconds: f64::from(row),
            values: vec![(0, Reading::from(5.0))],
        })
        .collect();
    let error = fit(&still, 1, &Request::default()).unwrap_err().to_string();
    assert!(error.contains("that vary"), "{error}");
}

/// A long table is searched by stretches of it first: what is found is as likely as what a search of all readings finds, and within its errors.
#[test]
fn a_long_table_is_fitted_as_well_as_a_short_one() {
    let drifting = SensorModel {
        slope: 2e-4,
        ..exact(0.5)
    };
    let late = SensorModel {
        delay: 1.5,
        gain: 0.9,
        ..exact(0.6)
    };
    let truth = walk(0.3, vec![exact(0.4), drifting, late]);
    let request = Request {
        reference: Some(0),
        slope: true,
        gain: true,
        delay: true,
        ..Request::default()
    };
    let rows = record(8, &truth, &[], 5000);
    let calls = std::cell::Cell::new(0);
    let found = fit_watched(&rows, 3, &request, &|| {
        calls.set(calls.get() + 1);
        std::ops::ControlFlow::Continue(())
    });
    let found = found.unwrap().unwrap();
    assert!(found.log_likelihood > truth.log_likelihood(&rows).unwrap().0 - 0.5, "{found:?}");
    for one in &found.estimates {
        let off = (one.value - true_value(&truth, one.quantity)) / one.standard_error;
        assert!(off.abs() < 4.0, "{one:?}");
    }
}

#[test]
fn a_wild_value_and_a_unit_change_nothing() {
    let (_, truth, _, request) = kinds().swap_remove(0);
    let rows = record(5, &truth, &[], ROWS);
    let plain = fit(&rows, 3, &request).unwrap();
    let mut wild = rows.clone();
    wild[50].values[0].1 = Reading::from(1000.0);
    let found = fit(&wild, 3, &request).unwrap();
    assert!((found.model.sensors[0].noise / plain.model.sensors[0].noise).ln().abs() < 0.1, "{found:?}");
    for unit in [1e-4, 1e4] {
        let scaled: Vec<Instant> = rows
            .iter()
            .map(|row| Instant {
                seconds: row.seconds,
                values: row
                    .values
                    .iter()
                    .map(|(n, one)| (*n, Reading::from(one.value().unwrap() * unit)))
                    .collect(),
            })
            .collect();
        let found = fit(&scaled, 3, &request).unwrap();
        for (one, other) in found.estimates.iter().zip(&plain.estimates) {
            let off = (one.value / unit - other.value).abs();
            assert!(off < 0.02 * other.standard_error, "{one:?} {other:?}");
        }
    }
}

#[test]
fn bad_readings_are_refused() {
    let truth = walk(0.3, vec![exact(0.5)]);
    let rows = record(1, &truth, &[], 40);
    assert!(fit(&[], 1, &Request::default()).is_err());
    assert!(
        fit(
            &rows,
            1,
            &Request {
                reference: Some(3),
                ..Request::default()
            }
        )
        .is_err()
    );
    assert!(
        fit(
            &rows,
            1,
            &Request {
                noises: vec![Some(-1.0)],
                ..Request::default()
            }
        )
        .is_err()
    );
    for value in [f64::NAN, f64::INFINITY, -1e200] {
        let mut wrong = rows.clone();
        wrong[3].values[0].1 = Reading::from(value);
        assert!(fit(&wrong, 1, &Request::default()).is_err());
    }
    let mut large = rows.clone();
    large.iter_mut().for_each(|row| row.values[0].1 = Reading::from(1e155));
    assert!(fit(&large, 1, &Request::default()).is_err());
    let mut wrong = rows;
    wrong.swap(3, 4);
    assert!(fit(&wrong, 1, &Request::default()).is_err());
}

/// A level that jumps is not fitted by a larger change.
#[test]
fn jumps_are_neither_change_nor_noise() {
    for seed in 0..3 {
        let truth = walk(0.02, vec![exact(0.3), exact(0.5)]);
        let mut rows = record(seed, &truth, &[], 400);
        for (first, by) in [(80, 3.0), (150, -2.5), (220, 4.0), (330, 3.0)] {
            for (_, reading) in rows[first..].iter_mut().flat_map(|row| &mut row.values) {
                *reading = Reading::from(reading.value().unwrap() + by);
            }
        }
        let found = fit(&rows, 2, &Request::default()).unwrap();
        assert_eq!(found.jumps, [80.0, 150.0, 220.0, 330.0], "{seed}");
        let noises = [0.3, 0.5].iter().zip(&found.model.sensors);
        assert!(noises.clone().all(|(truth, own)| (own.noise / truth).ln().abs() < 0.2), "{seed}: {:?}", found.model);
        assert!(found.model.change < 0.06, "{seed}: {:?}", found.model);
    }
}

/// Defects: gains of 40 and of .002, and one of a sensor in another place of the scale, ended at 18, at 1 and at 1, with errors of a hundredth: the search began at a
/// gain of 1, and the width of all values was that of the level. A delay of 20 readings was not reached.
#[test]
fn gains_of_any_size_and_long_delays_are_reached() {
    let reference = Request {
        reference: Some(0),
        gain: true,
        ..Request::default()
    };
    let near = |truth: &LevelModel, rows: &[Instant], request: &Request| {
        let found = fit(rows, truth.sensors.len(), request).unwrap();
        assert_eq!(found.refused, []);
        for one in &found.estimates {
            let off = (one.value - true_value(truth, one.quantity)) / one.standard_error;
            assert!(off.abs() < 4.0, "{one:?} of {truth:?}");
        }
    };
    for (mean, gain, bias) in [
        (20.0, 40.0, 700.0),
        (20.0, 2e-3, 0.7),
        (20.0, -3.0, 0.0),
        (1e9, 1.2, -1.2e9),
    ] {
        let other = SensorModel {
            gain,
            bias,
            ..exact(0.4 * f64::abs(gain))
        };
        let truth = LevelModel {
            mean,
            ..walk(0.4, vec![exact(0.2), other])
        };
        near(&truth, &record(3, &truth, &[], ROWS), &reference);
    }
    let late = SensorModel {
        gain: -0.7,
        delay: 19.5,
        ..exact(0.3)
    };
    let truth = walk(0.5, vec![exact(0.2), late]);
    let request = Request {
        delay: true,
        ..reference
    };
    near(&truth, &record(4, &truth, &[], 2 * ROWS), &request);
}

/// Defect: the noise of a sensor that is there twice was found to be a thousandth of what it is.
#[test]
fn a_copy_is_no_second_measurement() {
    let truth = walk(
        0.5,
        vec![
            exact(0.3),
            SensorModel {
                bias: 1.0,
                ..exact(0.5)
            },
        ],
    );
    let rows = record(2, &truth, &[], ROWS);
    let plain = fit(&rows, 2, &Request::default()).unwrap();
    let mut more = rows.clone();
    for (row, instant) in more.iter_mut().enumerate() {
        let copy = instant.values[0].1;
        // Not of every row.
        instant.values.extend((row % 3 != 0).then_some((2, copy)));
    }
    let found = fit(&more, 3, &Request::default()).unwrap();
    assert_eq!((found.log_likelihood, &found.estimates), (plain.log_likelihood, &plain.estimates));
    let reason = &found.refused.last().unwrap();
    assert!(
        reason.quantity == Quantity::Bias(2) && reason.reason.contains("repeat those of sensor 0"),
        "{reason:?}"
    );
    // The reference stays.
    let request = Request {
        reference: Some(2),
        ..Request::default()
    };
    assert_eq!(fit(&more, 3, &request).unwrap().relative_to, 2);
}

/// Defect: a threshold was first guessed in the middle of the level, and delays that suit that guess (60 rows here) were never left.
#[test]
fn a_threshold_at_the_edge_and_delays_are_found_together() {
    let switch = SensorModel {
        bias: -1.5,
        ..exact(0.1)
    };
    let truth = LevelModel {
        time_constant: Some(20.0),
        mean: 0.0,
        ..walk(0.4, vec![exact(0.1), exact(0.3), switch])
    };
    let request = Request {
        reference: Some(0),
        delay: true,
        ..Request::default()
    };
    for seed in 0..3 {
        let rows = record(seed, &truth, &[2], 300);
        let found = fit(&rows, 3, &request).unwrap();
        let sensor = found.model.sensors[2];
        assert!(sensor.delay.abs() < 2.0 && (sensor.bias + 1.5).abs() < 0.5, "{seed}: {sensor:?}");
        assert!(found.log_likelihood > truth.log_likelihood(&rows).unwrap().0 - 20.0, "{seed}");
    }
}

/// Defect: only delays up to 64 readings were looked for, and with another one wrong noises came with small errors.
#[test]
fn a_delay_of_a_hundred_readings_is_found() {
    let late = SensorModel {
        gain: -1.5,
        bias: 2.0,
        ..exact(0.3)
    };
    let truth = walk(0.4, vec![exact(0.2), late]);
    let request = Request {
        reference: Some(0),
        gain: true,
        delay: true,
        ..Request::default()
    };
    for seed in 0..3 {
        let rows = record(seed, &truth, &[], 503);
        let delayed = |row: usize| Instant {
            seconds: row as f64,
            values: vec![rows[row + 103].values[0], rows[row].values[1]],
        };
        let found = fit(&(0..400).map(delayed).collect::<Vec<_>>(), 2, &request).unwrap();
        let sensor = found.model.sensors[1];
        assert!((sensor.delay - 103.0).abs() < 1.0 && (sensor.gain + 1.5).abs() < 0.3, "{seed}: {sensor:?}");
    }
}

/// Defect: nothing told that a level which returns, or has a cycle, was fitted as a walk: its change and its noises were off by several of their errors.
#[test]
fn a_level_that_is_no_walk_is_told() {
    let request = Request::default();
    let (mut returning, mut cyclic, mut wandering) = (0, 0, 0);
    for seed in 0..6 {
        let truth = LevelModel {
            time_constant: Some(8.0),
            ..walk(0.5, vec![exact(0.3)])
        };
        let found = fit(&record(seed, &truth, &[], 500), 1, &request).unwrap();
        returning += u32::from(found.returns.is_some_and(|seconds| (3.0..20.0).contains(&seconds)));
        let truth = walk(0.3, vec![exact(0.3)]);
        let rows = record(seed, &truth, &[], 500);
        let found = fit(&rows, 1, &request).unwrap();
        wandering += u32::from(found.returns.is_some() || found.tests[0].is_persistent());
        let cycle = |row: usize| 3.0 * (row as f64 * std::f64::consts::TAU / 144.0).sin();
        let still = walk(1e-3, vec![exact(0.2)]);
        let mut rows = record(seed, &still, &[], 500);
        for (row, instant) in rows.iter_mut().enumerate() {
            for (_, reading) in &mut instant.values {
                *reading = Reading::from(reading.value().unwrap() + cycle(row));
            }
        }
        cyclic += u32::from(fit(&rows, 1, &request).unwrap().tests[0].is_persistent());
    }
    assert_eq!((returning, cyclic, wandering), (6, 6, 0));
}

/// Defect: noise that two of three sensors share was only looked for beside a reference.
#[test]
fn shared_noise_is_seen_beside_a_third_sensor() {
    let mut rng = Stream::new(9).rng();
    let mut alarms = 0;
    for seed in 0..4 {
        let mut rows = record(seed, &walk(0.3, vec![exact(0.3); 3]), &[], 500);
        let certain = |rows: &[Instant]| {
            let found = fit(rows, 3, &Request::default()).unwrap();
            let certain = found.correlations.iter().filter(|one| one.is_certain());
            certain.map(|one| one.sensors).collect::<Vec<_>>()
        };
        alarms += certain(&rows).len();
        for row in &mut rows {
            let common = 0.4 * rng.sample::<f64, _>(StandardNormal);
            for (_, reading) in &mut row.values[1..] {
                *reading = Reading::from(reading.value().unwrap() + common);
            }
        }
        assert_eq!(certain(&rows), [(1, 2)], "{seed}");
    }
    assert_eq!(alarms, 0);
}
