//! Noise, change and offsets found from recorded values, against the numbers that made them.

use fewbits_core::Gaussian;
use fewbits_filters::calibration::{Calibration, Instant, Level, Number, Reading, median, offsets, shift_deviation};
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::Stream;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

fn noise(rng: &mut dyn Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// A walk of steps of `change`, and sensors of these noises and offsets.
fn recorded(seed: u64, change: f64, noises: &[f64], offsets: &[f64], rows: u32) -> Vec<Instant> {
    let mut rng = Stream::new(seed).rng();
    let mut level = 20.0;
    (0..rows)
        .map(|row| {
            level += change * noise(&mut rng);
            let value = |(n, size): (usize, &f64)| {
                (
                    n,
                    Reading::from(
                        level
                            + size * noise(&mut Stream::new(seed).indexed(row.into()).indexed(n as u64).rng())
                            + offsets.get(n).unwrap_or(&0.0),
                    ),
                )
            };
            Instant {
                seconds: f64::from(row),
                values: noises.iter().enumerate().map(value).collect(),
            }
        })
        .collect()
}

const UNKNOWN: Number = Number::Unknown { guess: 1.0, least: 0.0 };

fn found(instants: &[Instant], noises: &[Number]) -> Calibration {
    let prior = Gaussian::scalar(20.0, 100.0).unwrap();
    let level = Level {
        world: |change: f64| ContinuousLinear::random_walk(change * change),
        prior: &prior,
        period: None,
    };
    level.calibrate(instants, UNKNOWN, noises).unwrap()
}

/// Defect: with 2, 4 and 6 equal sensors half of the tables got .3 for .5; one noise was found for all.
#[test]
fn noise_of_each_sensor_is_found() {
    for noises in [
        vec![0.5; 2],
        vec![0.5; 4],
        vec![0.5; 6],
        vec![3.0, 0.5],
        vec![0.2, 0.5, 2.0, 0.5],
    ] {
        let mut misses = 0;
        for seed in 0..8 {
            let instants = recorded(seed, 0.05, &noises, &[], 200);
            let found = found(&instants, &vec![UNKNOWN; noises.len()]);
            for (found, true_noise) in found.noises.iter().zip(&noises) {
                // The deviation of the estimate from 200 values is five per cent.
                misses += u32::from((found / true_noise).ln().abs() > 0.2);
            }
        }
        assert!(misses <= 1, "{noises:?}: {misses}");
    }
}

#[test]
fn wild_values_do_not_move_what_is_found() {
    let mut instants = recorded(3, 0.02, &[0.05], &[], 200);
    for row in [40, 41, 90, 150] {
        instants[row].values[0].1 = 195.8.into();
    }
    let found = found(&instants, &[UNKNOWN]);
    assert!((found.noises[0] / 0.05).ln().abs() < 0.25, "{found:?}");
    assert!((found.change / 0.02).ln().abs() < 0.7, "{found:?}");
}

/// Values of a sensor that sends on change, whose silence says that the level is near its last value: noise and change are found from the
/// cells. Taken as values alone, the few that come make the noise as wide as the cells.
/// Defect: a jump that only the accurate one of three sensors can see made all its later values wild, so that a change of .1 and a noise of .02 were
/// likelier than none and .05.
#[test]
fn jumps_that_one_sensor_sees_are_neither_change_nor_noise() {
    for seed in 0..6 {
        let mut instants = recorded(seed, 0.001, &[0.05, 0.6, 0.6], &[], 400);
        let mut rng = Stream::new(seed).indexed(77).rng();
        for first in [60, 130, 210, 330] {
            let by = 0.5 + noise(&mut rng).abs();
            for (_, reading) in instants[first..].iter_mut().flat_map(|instant| &mut instant.values) {
                *reading = Reading::from(reading.value().unwrap() + by);
            }
        }
        let calibration = found(&instants, &[UNKNOWN; 3]);
        let (noises, change) = (&calibration.noises, calibration.change);
        assert!((0.043..0.057).contains(&noises[0]) && change < 0.02, "{seed}: {change}, {noises:?}");
        assert!(noises[1..].iter().all(|noise| (0.5..0.75).contains(noise)), "{seed}: {noises:?}");
    }
}

#[test]
fn silence_and_rounding_are_cells() {
    let (mut misses, width) = (0, 0.5);
    for seed in 0..8 {
        let mut instants = recorded(seed, 0.1, &[0.05], &[], 400);
        let mut last: Option<f64> = None;
        for instant in &mut instants {
            let value = instant.values[0].1.value().unwrap();
            match last.filter(|last| (value - last).abs() < width) {
                Some(last) => {
                    instant.values[0].1 = Reading::Within {
                        lower: last - width,
                        upper: last + width,
                    };
                }
                None => last = Some(value),
            }
        }
        let sent = found(&instants, &[Number::Unknown { guess: 0.3, least: 0.0 }]);
        misses += u32::from((sent.change / 0.1).ln().abs() > 0.5);
        // Whole steps of four deviations of the noise.
        let mut instants = recorded(seed, 0.1, &[0.25], &[], 400);
        for instant in &mut instants {
            let value = instant.values[0].1.value().unwrap().round();
            instant.values[0].1 = Reading::Within {
                lower: value - 0.5,
                upper: value + 0.5,
            };
        }
        let rounded = found(&instants, &[Number::Unknown { guess: 0.3, least: 0.0 }]);
        misses += u32::from((rounded.noises[0] / 0.25).ln().abs() > 0.5);
        println!("{sent:?} {rounded:?}");
    }
    assert!(misses <= 1, "{misses}");
}

/// Each row states its accuracy: only the change is left to be found, and it is not mistaken for the accuracies.
#[test]
fn stated_accuracies_are_used() {
    let instants: Vec<Instant> = recorded(4, 0.3, &[1.0], &[], 400)
        .into_iter()
        .zip(recorded(4, 0.3, &[1e-9], &[], 400))
        .enumerate()
        .map(|(row, (noisy, level))| {
            let deviation = [0.2, 1.0, 5.0][row % 3];
            let (value, level) = (noisy.values[0].1.value().unwrap(), level.values[0].1.value().unwrap());
            Instant {
                seconds: noisy.seconds,
                values: vec![(
                    0,
                    Reading::Value {
                        value: level + deviation * (value - level),
                        deviation: Some(deviation),
                    },
                )],
            }
        })
        .collect();
    let found = found(&instants, &[UNKNOWN]);
    assert!((found.change / 0.3).ln().abs() < 0.3, "{found:?}");
}

#[test]
fn known_numbers_stay_and_units_do_not_matter() {
    let instants = recorded(5, 0.05, &[0.5, 1.0], &[], 200);
    let fixed = found(&instants, &[Number::Known(0.4), UNKNOWN]);
    assert_eq!(fixed.noises[0], 0.4);
    let plain = found(&instants, &[UNKNOWN; 2]);
    for unit in [1e-4, 1e4] {
        let scaled = |instant: &Instant| Instant {
            seconds: instant.seconds,
            values: instant
                .values
                .iter()
                .map(|(n, value)| (*n, (value.value().unwrap() * unit).into()))
                .collect(),
        };
        let scaled: Vec<Instant> = instants.iter().map(scaled).collect();
        let prior = Gaussian::scalar(20.0 * unit, 100.0 * unit * unit).unwrap();
        let level = Level {
            world: |change: f64| ContinuousLinear::random_walk(change * change),
            prior: &prior,
            period: None,
        };
        let unknown = Number::Unknown {
            guess: unit,
            least: 0.0,
        };
        let found = level.calibrate(&scaled, unknown, &[unknown; 2]).unwrap();
        assert!((found.noises[0] / unit / plain.noises[0] - 1.0).abs() < 1e-6, "{found:?} {plain:?}");
        assert!((found.change / unit / plain.change - 1.0).abs() < 1e-6, "{found:?} {plain:?}");
    }
}

#[test]
fn what_cannot_be_calibrated_is_refused() {
    let prior = Gaussian::scalar(20.0, 100.0).unwrap();
    let level = Level {
        world: |change: f64| ContinuousLinear::random_walk(change * change),
        prior: &prior,
        period: None,
    };
    let good = recorded(5, 0.05, &[0.5, 1.0], &[], 20);
    assert!(level.calibrate(&good, UNKNOWN, &[UNKNOWN]).is_err());
    assert!(level.calibrate(&good, Number::Known(-1.0), &[UNKNOWN; 2]).is_err());
    let mut wrong = good.clone();
    wrong[3].values[0].1 = f64::NAN.into();
    assert!(level.calibrate(&wrong, UNKNOWN, &[UNKNOWN; 2]).is_err());
    let mut wrong = good;
    wrong.swap(3, 4);
    assert!(level.calibrate(&wrong, UNKNOWN, &[UNKNOWN; 2]).is_err());
    assert!(
        level
            .calibrate(&recorded(5, 0.0, &[0.0], &[], 20), UNKNOWN, &[UNKNOWN])
            .is_err()
    );
}

/// Defect: the median of an even number of values was the upper one of the middle two; every sensor was shifted by half a deviation.
#[test]
fn offsets_have_no_part_in_common() {
    assert_eq!((median(vec![1.0, 4.0]), median(vec![3.0, 1.0, 2.0]), median(Vec::new())), (2.5, 2.0, 0.0));
    for sensors in [2, 3, 4, 10] {
        let instants = recorded(7, 0.05, &vec![0.5; sensors], &[], 200);
        let found = offsets(&instants, sensors, None);
        assert!(median(found.clone()).abs() < 1e-9 && found.iter().all(|one| one.abs() < 0.2), "{found:?}");
    }
    let offset = [0.0, 2.0, 0.0, -1.0, 0.0];
    let mut instants = recorded(7, 0.05, &[0.5; 5], &offset, 200);
    instants[9].values[0].1 = 1e6.into();
    let found = offsets(&instants, 5, None);
    assert!(found.iter().zip(offset).all(|(one, other)| (one - other).abs() < 0.2), "{found:?}");
    // Of two sensors nothing says which is right: both are shifted to the middle.
    let found = offsets(&recorded(7, 0.05, &[0.5; 2], &[0.0, 2.0], 200), 2, None);
    assert!((found[0] + 1.0).abs() < 0.1 && (found[1] - 1.0).abs() < 0.1, "{found:?}");
}

/// Defect: a noise that began at the smallest number considered stayed there, though far larger ones explain the values as well: bands of no
/// width.
#[test]
fn a_noise_that_may_as_well_be_larger_is_not_left_at_the_least() {
    let instants = recorded(11, 1.0, &[0.01], &[], 200);
    let least = 1e-5;
    let calibration = found(&instants, &[Number::Unknown { guess: least, least }]);
    assert!(calibration.noises[0] > 1e-3, "{calibration:?}");
}

/// Defect: at the lower end of the search a noise was not raised, since the search had further to go up than it has from its start: bands of no
/// width, in one of eight tables.
#[test]
fn a_noise_at_the_end_of_the_search_is_raised() {
    for seed in 0..12 {
        let instants = recorded(300 + seed, 0.5, &[0.02, 0.5], &[], 200);
        let calibration = found(&instants, &[Number::Unknown { guess: 0.5, least: 0.0 }; 2]);
        assert!((0.01..0.2).contains(&calibration.noises[0]), "{seed}: {calibration:?}");
    }
}

/// Noises of many sensors are found in a time that grows with the number of readings, and are as exact as those of few.
#[test]
fn noises_of_300_sensors_are_found() {
    let noises: Vec<f64> = (0..300).map(|sensor| 0.1 * 1.01_f64.powi(sensor)).collect();
    let mut instants = recorded(7, 0.3, &noises, &[], 60);
    // A jump, which is no noise, and wild values.
    for (row, instant) in instants.iter_mut().enumerate() {
        for (sensor, reading) in &mut instant.values {
            let shift = if row >= 30 { 40.0 } else { 0.0 } + if row == 10 && *sensor % 5 == 0 { -100.0 } else { 0.0 };
            *reading = Reading::from(reading.value().unwrap() + shift);
        }
    }
    let calibration = found(&instants, &vec![UNKNOWN; 300]);
    let off = |(found, noise): (&f64, &f64)| (found / noise).ln() * 120_f64.sqrt();
    let off: Vec<f64> = calibration.noises.iter().zip(&noises).map(off).collect();
    let mean = off.iter().sum::<f64>() / 300.0;
    let square = off.iter().map(|one| one * one).sum::<f64>() / 300.0;
    // The root of the mean of the square is somewhat above the likeliest number.
    assert!((-0.1..0.5).contains(&mean) && (0.7..1.5).contains(&square), "{mean} {square}");
    assert!((0.2..0.45).contains(&calibration.change), "{}", calibration.change);
}

/// What the offsets' errors shift the level is as large as it is found to be, over many tables. Where sensors have the same offset, which of
/// them is the middle one changes from half sample to half sample, and the deviation is found too large, never too small.
#[test]
fn the_shift_by_offsets_is_as_large_as_said() {
    let apart = [0.0, 6.0, -6.0, 12.0, -12.0, 18.0, -18.0];
    for noises in [
        &[0.5, 1.0][..],
        &[0.3, 1.0, 0.5, 2.0],
        &[0.2, 1.0, 1.0, 1.0, 1.0],
        &[0.5; 7],
    ] {
        let weights: Vec<f64> = noises.iter().map(|noise| 1.0 / (noise * noise)).collect();
        let sum: f64 = weights.iter().sum();
        for (true_offsets, largest) in [(&apart[..noises.len()], 1.3), (&[0.0; 7][..noises.len()], 2.0)] {
            let share = |offsets: &[f64]| {
                offsets
                    .iter()
                    .zip(&weights)
                    .map(|(one, weight)| one * weight)
                    .sum::<f64>()
                    / sum
            };
            let middle = median(true_offsets.to_vec());
            let truth = share(&true_offsets.iter().map(|one| one - middle).collect::<Vec<_>>());
            let (mut squares, mut said, tables) = (0.0, 0.0, 80);
            for seed in 0..tables {
                let instants = recorded(1000 + seed, 0.05, noises, true_offsets, 200);
                squares += (share(&offsets(&instants, noises.len(), None)) - truth).powi(2);
                said += shift_deviation(&instants, &weights, None).powi(2);
            }
            // The ratio varies by a twelfth with so many tables.
            let ratio = (said / squares).sqrt();
            assert!((0.75..largest).contains(&ratio), "{noises:?} {true_offsets:?}: {ratio}");
        }
    }
    assert_eq!(shift_deviation(&recorded(1, 0.1, &[0.5], &[], 100), &[1.0], None), 0.0);
}

/// The likelihood of a level that silence cuts, by brute force: a fixed grid, and every transition.
fn by_brute_force(instants: &[Instant], change: f64, noise: f64) -> f64 {
    const NODES: usize = 501;
    let spacing = 0.01;
    let place = |i: usize| 20.0 + spacing * (i as f64 - 250.0);
    let normal =
        |x: f64, deviation: f64| (-0.5 * (x / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt());
    let mut density: Vec<f64> = (0..NODES).map(|i| spacing * normal(place(i) - 20.0, 0.5)).collect();
    let mut total = 0.0;
    for (row, instant) in instants.iter().enumerate() {
        if row > 0 {
            let from = |i: usize| {
                let near = i.saturating_sub(60)..(i + 61).min(NODES);
                near.map(|j| density[j] * spacing * normal(place(i) - place(j), change))
                    .sum::<f64>()
            };
            density = (0..NODES).map(from).collect();
        }
        // One in 500 readings is wild.
        let said = |x: f64| match instant.values[0].1 {
            Reading::Value { value, .. } => (0.998 * normal(value - x, noise), 0.002),
            Reading::Within { lower, upper } => {
                let below = |edge: f64| fewbits_numerics::normal::cdf((edge - x) / noise);
                (0.998 * (below(upper) - below(lower)), 0.002 * (upper - lower))
            }
        };
        let range = range(instants);
        let weigh = |(i, p): (usize, &mut f64)| {
            let (right, wild) = said(place(i));
            *p *= right
                + if wild == 0.002 {
                    wild / range
                } else {
                    (wild / range).min(0.002)
                };
        };
        density.iter_mut().enumerate().for_each(weigh);
        let sum: f64 = density.iter().sum();
        total += sum.ln();
        density.iter_mut().for_each(|p| *p /= sum);
    }
    total
}

fn range(instants: &[Instant]) -> f64 {
    let ends = instants.iter().flat_map(|instant| match instant.values[0].1 {
        Reading::Value { value, .. } => [value, value],
        Reading::Within { lower, upper } => [lower, upper],
    });
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), end| (low.min(end), high.max(end)));
    high - low
}

/// What a sensor that sends on change says of a walk from 20.
fn sent_on_change(seed: u64, change: f64, deviation: f64, rows: u32) -> Vec<Instant> {
    let mut rng = Stream::new(seed).rng();
    let (mut level, mut last) = (20.0, 20.0);
    let mut said = |row: u32| {
        level += change * noise(&mut rng);
        let value = level + deviation * noise(&mut rng);
        if row == 0 || f64::abs(value - last) >= 0.5 {
            last = value;
            return Reading::from(value);
        }
        let (lower, upper) = (last - 0.5, last + 0.5);
        Reading::Within { lower, upper }
    };
    let instant = |row| Instant {
        seconds: f64::from(row),
        values: vec![(0, said(row))],
    };
    (0..rows).map(instant).collect()
}

fn on_grid(instants: &[Instant], change: Number, deviation: f64) -> Calibration {
    let level = Level {
        world: |change: f64| ContinuousLinear::random_walk(change * change),
        prior: &Gaussian::scalar(20.0, 0.25).unwrap(),
        period: None,
    };
    level
        .calibrate_on_grid(instants, change, &[Number::Known(deviation)])
        .unwrap()
}

/// Defect: noise and change of a sensor that sends on change were found by the moments of a belief that is no Gaussian.
#[test]
fn the_likelihood_on_a_grid_is_that_of_brute_force() {
    let instants = sent_on_change(31, 0.08, 0.05, 150);
    for (change, deviation) in [(0.08, 0.05), (0.05, 0.1), (0.15, 0.03)] {
        let found = on_grid(&instants, Number::Known(change), deviation).log_likelihood;
        let exact = by_brute_force(&instants, change, deviation);
        assert!((found - exact).abs() < 0.3, "{change} {deviation}: {found} {exact}");
    }
}

/// Defect: a value whose noise is far below the distance of the nodes was taken for wild, as none of them was near it, and the change that was
/// found was half of the right one. If all few values are wild, the likelihood has a second maximum, at which the search ended.
#[test]
fn values_far_sharper_than_the_grid_are_not_wild() {
    let instants = sent_on_change(6, 0.05, 0.005, 250);
    let mut highest = f64::NEG_INFINITY;
    for change in [0.03, 0.05, 0.08] {
        let found = on_grid(&instants, Number::Known(change), 0.005).log_likelihood;
        let exact = by_brute_force(&instants, change, 0.005);
        highest = highest.max(exact);
        assert!((found - exact).abs() < 0.5, "{change}: {found} {exact}");
    }
    let guess = 0.1;
    let found = on_grid(&instants, Number::Unknown { guess, least: 0.0 }, 0.005);
    assert!(found.log_likelihood > highest - 0.5 && (0.025..0.1).contains(&found.change), "{found:?} {highest}");
}

/// Also on a grid the level may jump where one sensor agrees with the prediction.
#[test]
fn jumps_that_one_sensor_sees_are_no_change_on_a_grid() {
    let mut instants = recorded(2, 0.001, &[0.05, 0.6, 0.6], &[], 120);
    for (first, by) in [(30, 0.8), (70, 0.9)] {
        for (_, reading) in instants[first..].iter_mut().flat_map(|instant| &mut instant.values) {
            *reading = Reading::from(reading.value().unwrap() + by);
        }
    }
    let level = Level {
        world: |change: f64| ContinuousLinear::random_walk(change * change),
        prior: &Gaussian::scalar(20.0, 0.25).unwrap(),
        period: None,
    };
    let noises = [0.05, 0.6, 0.6].map(Number::Known);
    let found = level.calibrate_on_grid(&instants, UNKNOWN, &noises).unwrap();
    assert!(found.change < 0.02, "{found:?}");
    // Where the belief is nearly Gaussian both likelihoods are the same.
    let moments = level.calibrate(&instants, UNKNOWN, &noises).unwrap();
    assert!((found.log_likelihood - moments.log_likelihood).abs() < 1.0, "{found:?} {moments:?}");
}

/// Of a level that hardly moves, `n` readings tell the logarithm of the noise with a deviation of `1 / sqrt(2 n)`, and the level's deviation is a share
/// of the noise. What may be wild tells a little less. A noise far below the change is left open.
#[test]
fn what_readings_leave_open_is_that_of_their_information() {
    let prior = Gaussian::scalar(20.0, 100.0).unwrap();
    let level = Level {
        world: |change: f64| ContinuousLinear::random_walk(change * change),
        prior: &prior,
        period: None,
    };
    let of = |noise: f64| Number::Unknown {
        guess: noise,
        least: 0.0,
    };
    for rows in [100, 400] {
        let instants = recorded(61, 1e-6, &[0.5], &[], rows);
        let noise = found(&instants, &[UNKNOWN]).noises[0];
        let open = level
            .openness(&instants, Number::Known(1e-6), &[of(noise)])
            .unwrap()
            .unwrap();
        let expected = 1.0 / (1.0 + 2.0 * f64::from(rows)).sqrt();
        assert!((open.of_number / expected - 1.0).abs() < 0.2, "{open:?} {expected}");
        assert!((open.of_level / expected - 1.0).abs() < 0.2, "{open:?} {expected}");
        assert_eq!(open.number, Some(0));
        assert_eq!(
            level
                .openness(&instants, Number::Known(1e-6), &[Number::Known(noise)])
                .unwrap(),
            None
        );
    }
    let instants = recorded(62, 1.0, &[0.05, 3.0], &[], 200);
    let numbers = found(&instants, &[UNKNOWN; 2]);
    let noises = [of(numbers.noises[0]), of(numbers.noises[1])];
    let open = level.openness(&instants, of(numbers.change), &noises).unwrap().unwrap();
    assert!(open.of_level > 0.25 && open.number == Some(0), "{open:?}");
}
