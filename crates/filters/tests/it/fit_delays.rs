//! Delays of several sensors against those that made the readings.

use fewbits_filters::calibration::{Instant, Reading};
use fewbits_filters::fit::{Fit, LevelModel, Quantity, Request, SensorModel, fit};
use fewbits_monte_carlo::Stream;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

fn uniform(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Sensors of random noises, offsets and delays up to ten intervals, and the readings of a walk. Of 28 tables in a row the second half has delays
/// that are whole intervals, and every second seven has sensors of unequal rates.
fn table(seed: u64) -> (Vec<Instant>, LevelModel) {
    let sensors = 2 + (seed % 7) as usize;
    let (is_unequal, is_whole) = (seed / 7 % 2 == 1, seed / 14 % 2 == 1);
    let rows = if sensors > 4 { 200.0 } else { 300.0 };
    let mut rng = Stream::new(seed).named("delays").rng();
    let mut sensor = |place: usize| {
        let delay = uniform(&mut rng, 0.0, 10.0);
        let noise = uniform(&mut rng, -2.0, 0.3).exp();
        let bias = uniform(&mut rng, -3.0, 3.0);
        let is_reference = place == 0;
        SensorModel {
            bias: if is_reference { 0.0 } else { bias },
            delay: match () {
                () if is_reference => 0.0,
                () if is_whole => delay.round(),
                () => delay,
            },
            ..SensorModel::exact(noise)
        }
    };
    let models: Vec<SensorModel> = (0..sensors).map(&mut sensor).collect();
    let change = uniform(&mut rng, -1.5, 0.3).exp();
    // Time of the level, sensor, and time of the reading.
    let mut all = Vec::new();
    for (sensor, own) in models.iter().enumerate() {
        let (mut every, mut seconds) = (1.0, 0.0);
        if is_unequal {
            every = [1.0, 1.0, 2.0, 3.0, 0.5, 1.7][(rng.random::<u64>() % 6) as usize];
            seconds = (uniform(&mut rng, 0.0, 1.0) * 10.0).round() / 10.0;
        }
        while seconds < rows {
            all.push((seconds - own.delay, sensor, seconds));
            seconds += every;
        }
    }
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    let (mut level, mut before) = (20.0, all[0].0);
    let mut read = Vec::new();
    for (at, sensor, seconds) in all {
        let own = &models[sensor];
        level += change * f64::sqrt(at - before) * rng.sample::<f64, _>(StandardNormal);
        before = at;
        read.push((seconds, sensor, level + own.bias + own.noise * rng.sample::<f64, _>(StandardNormal)));
    }
    read.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
    let instant = |group: &[(f64, usize, f64)]| Instant {
        seconds: group[0].0,
        values: group.iter().map(|one| (one.1, Reading::from(one.2))).collect(),
    };
    let instants = read.chunk_by(|one, other| one.0 == other.0).map(instant).collect();
    let truth = LevelModel {
        change,
        time_constant: None,
        mean: 20.0,
        sensors: models,
    };
    (instants, truth)
}

/// By how many of its errors each delay is off.
fn off(found: &Fit, truth: &LevelModel) -> Vec<f64> {
    let delays = found.estimates.iter().filter_map(|one| match one.quantity {
        Quantity::Delay(sensor) => Some((one.value - truth.sensors[sensor].delay) / one.standard_error),
        _ => None,
    });
    delays.collect()
}

fn found(rows: &[Instant], truth: &LevelModel) -> Fit {
    let request = Request {
        reference: Some(0),
        delay: true,
        ..Request::default()
    };
    fit(rows, truth.sensors.len(), &request).unwrap()
}

/// Defects: beside a noisy reference all delays were off together, by up to 170 of their errors: each was moved alone, and the others held it. Where kinks
/// of the likelihood are close the errors were too small.
#[test]
fn delays_of_several_sensors_are_found_together() {
    for seed in [18, 31] {
        let (rows, truth) = table(seed);
        let found = found(&rows, &truth);
        let best = truth.log_likelihood(&rows).unwrap().0;
        assert!(found.log_likelihood > best - 0.5, "{seed}: {} for {best}", found.log_likelihood);
        let off = off(&found, &truth);
        assert!(off.iter().all(|off| off.abs() < 3.0), "{seed}: {off:?}");
    }
}

/// The measurement of `docs/fit.md`.
#[test]
#[ignore = "minutes"]
fn delays_of_many_tables() {
    let count: u64 = std::env::var("FEWBITS_TABLES")
        .ok()
        .map_or(112, |text| text.parse().unwrap());
    let mut all = Vec::new();
    for seed in 0..count {
        let (rows, truth) = table(seed);
        let found = found(&rows, &truth);
        let own = off(&found, &truth);
        let is_below = truth.log_likelihood(&rows).unwrap().0 > found.log_likelihood + 0.1;
        let worst = own.iter().fold(0.0, |worst: f64, off| worst.max(off.abs()));
        if is_below || worst > 3.0 {
            println!("{seed}: below the truth {is_below}, {own:.1?}");
        }
        all.extend(own);
    }
    let within = all.iter().filter(|off| off.abs() < 1.96).count();
    let worst = all.iter().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    println!("{within} of {} within 1.96 errors, worst {worst:.1}", all.len());
}
