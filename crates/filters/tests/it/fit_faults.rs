//! Faults of sensors that are no parameters of the model: named where they are, and hardly ever where they are not.

use crate::fit_worlds::{exact, record, true_value, walk};
use fewbits_filters::calibration::{Instant, Reading};
use fewbits_filters::fit::{FaultKind, LevelModel, Request, SensorModel, fit};
use fewbits_monte_carlo::Stream;
use rand::{Rng, RngExt};

const ROWS: usize = 300;
/// Worlds in which the fault is large beside what the readings tell.
const FLIPS: [u64; 3] = [3, 8, 15];
const HYSTERESIS: [u64; 3] = [1, 2, 3];
const PLAY: [u64; 3] = [0, 1, 4];

fn uniform(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// A sensor of random noise and offset.
fn sensor(rng: &mut impl Rng) -> SensorModel {
    SensorModel {
        bias: uniform(rng, -3.0, 3.0),
        ..exact(uniform(rng, -1.5, 0.5).exp())
    }
}

/// A sensor of bits with a threshold that the level crosses.
fn switch(rng: &mut impl Rng) -> SensorModel {
    SensorModel {
        bias: -20.0 - uniform(rng, -1.0, 1.0),
        ..exact(uniform(rng, -1.5, 0.0).exp())
    }
}

/// The level of a world whose thresholds are crossed now and then.
fn returning(change: f64, sensors: Vec<SensorModel>) -> LevelModel {
    LevelModel {
        time_constant: Some(20.0),
        ..walk(change, sensors)
    }
}

fn exchange(rows: &mut [Instant], sensor: usize, mut of: impl FnMut(usize, Reading) -> Option<Reading>) {
    for (row, instant) in rows.iter_mut().enumerate() {
        let Some(place) = instant.values.iter().position(|one| one.0 == sensor) else {
            continue;
        };
        match of(row, instant.values[place].1) {
            Some(other) => instant.values[place].1 = other,
            None => {
                instant.values.remove(place);
            }
        }
    }
}

/// Leaves out values of a sensor in stretches of random lengths.
fn with_gaps(rows: &mut [Instant], sensor: usize, rng: &mut impl Rng) {
    let (begins, ends) = (uniform(rng, 0.02, 0.2), uniform(rng, 0.1, 0.9));
    let mut is_absent = false;
    exchange(rows, sensor, |_, one| {
        is_absent = rng.random::<f64>() < if is_absent { 1.0 - ends } else { begins };
        (!is_absent).then_some(one)
    });
}

/// Two sensors of values and one of bits, whose level is found.
fn bits_world(seed: u64) -> (LevelModel, Request) {
    let mut rng = Stream::new(seed).named("world").rng();
    let truth = returning(uniform(&mut rng, -1.2, 0.0).exp(), vec![sensor(&mut rng), switch(&mut rng)]);
    let anchored = SensorModel {
        bias: 0.0,
        ..truth.sensors[0]
    };
    let truth = LevelModel {
        sensors: vec![anchored, truth.sensors[1]],
        ..truth
    };
    let request = Request {
        time_constant: true,
        ..Request::default()
    };
    (truth, request)
}

fn values_world(seed: u64, sensors: usize) -> LevelModel {
    let mut rng = Stream::new(seed).named("world").rng();
    let mut sensors: Vec<SensorModel> = (0..sensors).map(|_| sensor(&mut rng)).collect();
    sensors[0].bias = 0.0;
    walk(uniform(&mut rng, -2.0, 0.5).exp(), sensors)
}

/// The reading of a switch whose threshold moves by `half` in the direction of the other state. The level is that of an exact third sensor.
fn hysteretic(rows: &[Instant], seed: u64, own: &SensorModel, half: f64) -> Vec<Reading> {
    let mut rng = Stream::new(seed).named("hysteresis").rng();
    let mut before = 0.0;
    let mut of = |row: &Instant| {
        let level = row.values.last().unwrap().1.value().unwrap();
        let normal: f64 = rng.sample(rand_distr::StandardNormal);
        let is_above = level + own.bias + own.noise * normal + half * before > 0.0;
        before = if is_above { 1.0 } else { -1.0 };
        Reading::bit(is_above)
    };
    rows.iter().map(&mut of).collect()
}

/// Instants, the parameters that made them, and what is looked for.
fn world(kind: &str, seed: u64) -> (Vec<Instant>, LevelModel, Request) {
    let mut rng = Stream::new(seed).named(kind).rng();
    let relative = Request::default();
    let gains = Request {
        gain: true,
        delay: true,
        ..Request::default()
    };
    match kind {
        "two" | "three" | "ten" => {
            let count = [("two", 2), ("three", 3), ("ten", 10)]
                .iter()
                .find(|one| one.0 == kind)
                .unwrap()
                .1;
            let truth = values_world(seed, count);
            (record(seed, &truth, &[], ROWS), truth, relative)
        }
        "gains" => {
            let mut truth = values_world(seed, 3);
            truth.sensors[1].gain = 1.4;
            truth.sensors[2].delay = 1.5;
            (record(seed, &truth, &[], ROWS), truth, gains)
        }
        "one gaps" | "three gaps" => {
            let count = if kind == "one gaps" { 1 } else { 3 };
            let truth = values_world(seed, count);
            let mut rows = record(seed, &truth, &[], ROWS);
            (0..count).for_each(|sensor| with_gaps(&mut rows, sensor, &mut rng));
            rows.retain(|row| count > 1 || !row.values.is_empty());
            (rows, truth, relative)
        }
        "one drops" | "two drops" => {
            let count = if kind == "one drops" { 1 } else { 2 };
            let truth = values_world(seed, count);
            let mut rows = record(seed, &truth, &[], ROWS);
            let last = count - 1;
            let mut values: Vec<f64> = rows.iter().map(|row| row.values[last].1.value().unwrap()).collect();
            values.sort_by(f64::total_cmp);
            let limit = values[values.len() * 4 / 5];
            exchange(&mut rows, last, |_, one| one.value().filter(|value| *value <= limit).map(Reading::from));
            rows.retain(|row| count > 1 || !row.values.is_empty());
            (rows, truth, relative)
        }
        "play" | "wide play" => {
            // The second sensor lags by one or three of its noises.
            let mut truth = values_world(seed, 2);
            truth.sensors.push(exact(1e-9));
            let mut rows = record(seed, &truth, &[], ROWS);
            let own = truth.sensors[1];
            let (half, mut middle) = (if kind == "play" { own.noise } else { 3.0 * own.noise }, truth.mean);
            for row in &mut rows {
                let level = row.values.pop().unwrap().1.value().unwrap();
                let noise = row.values[1].1.value().unwrap() - level;
                middle = f64::clamp(middle, level - half, level + half);
                row.values[1].1 = Reading::from(middle + noise);
            }
            truth.sensors.pop();
            (rows, truth, relative)
        }
        "bits" | "flips" | "hysteresis" => {
            let (mut truth, request) = bits_world(seed);
            truth.sensors.push(exact(1e-9));
            let mut rows = record(seed, &truth, &[1], ROWS);
            let own = truth.sensors[1];
            if kind == "hysteresis" {
                let bits = hysteretic(&rows, seed, &own, 1.5 * own.noise);
                exchange(&mut rows, 1, |row, _| Some(bits[row]));
            }
            if kind == "flips" {
                exchange(&mut rows, 1, |_, one| {
                    let is_inverted = rng.random::<f64>() < 0.04;
                    Some(if is_inverted {
                        Reading::bit(one == Reading::bit(false))
                    } else {
                        one
                    })
                });
            }
            rows.iter_mut().for_each(|row| {
                row.values.pop();
            });
            truth.sensors.pop();
            (rows, truth, request)
        }
        other => unreachable!("{other}"),
    }
}

/// Defect: bits that are inverted, a switch with another threshold for rises, a sensor that lags behind and values that a logger drops made numbers wrong by
/// several of their errors without a word.
#[test]
fn faults_are_named() {
    for (kind, fault, seeds) in [
        ("flips", FaultKind::InvertedBits, FLIPS),
        ("hysteresis", FaultKind::Hysteresis, HYSTERESIS),
        ("wide play", FaultKind::Lag, PLAY),
        ("one drops", FaultKind::AbsentAbove, [0, 1, 2]),
        ("two drops", FaultKind::AbsentAbove, [0, 1, 2]),
    ] {
        for seed in seeds {
            let (rows, truth, request) = world(kind, 5000 + seed);
            let found = fit(&rows, truth.sensors.len(), &request).unwrap();
            assert!(found.faults.iter().any(|one| one.kind == fault), "{kind} {seed}: {:?}", found.faults);
        }
    }
}

#[test]
fn sound_tables_have_no_faults() {
    for kind in ["two", "three", "gains", "one gaps", "three gaps", "bits"] {
        for seed in 0..4 {
            let (rows, truth, request) = world(kind, seed);
            let found = fit(&rows, truth.sensors.len(), &request).unwrap();
            assert_eq!(found.faults, [], "{kind} {seed}");
        }
    }
}

/// Defect: where a logger drops large values, the change, the noises and the offsets were off by several of their errors.
#[test]
fn numbers_allow_for_values_that_are_dropped() {
    let (mut within, mut all) = (0.0, 0.0_f64);
    for seed in 0..20 {
        let (rows, truth, request) = world("one drops", 5000 + seed);
        let found = fit(&rows, 1, &request).unwrap();
        for one in &found.estimates {
            let off = (one.value - true_value(&truth, one.quantity)) / one.standard_error;
            (within, all) = (within + f64::from(off.abs() < 2.0), all + 1.0);
        }
    }
    // 95 in a hundred, less four standard errors of so many.
    assert!(within >= (0.95 - 4.0 * (0.95 * 0.05 / all).sqrt()) * all, "{within} of {all}");
}

/// The measurement of `docs/fit.md`: of how many tables each test says something.
#[test]
#[ignore = "minutes"]
fn alarms_and_power_of_the_tests_of_faults() {
    let count: u64 = std::env::var("FEWBITS_TABLES")
        .ok()
        .map_or(100, |text| text.parse().unwrap());
    let kinds = std::env::var("FEWBITS_KINDS").unwrap_or_else(|_| {
        "two,three,ten,gains,one gaps,three gaps,bits,flips,hysteresis,play,wide play,one drops,two drops".to_owned()
    });
    for kind in kinds.split(',') {
        let mut said = [0_u64; 8];
        let mut evidence: Vec<(FaultKind, f64, f64)> = Vec::new();
        let (mut within, mut all) = (0_u32, 0_u32);
        let mut seeds = Vec::new();
        for seed in 0..count {
            let (rows, truth, request) = world(kind, 5000 + seed);
            let found = fit(&rows, truth.sensors.len(), &request).unwrap();
            for one in &found.estimates {
                let off = (one.value - true_value(&truth, one.quantity)) / one.standard_error;
                (within, all) = (within + u32::from(off.abs() < 1.96), all + 1);
            }
            let kinds = [
                FaultKind::InvertedBits,
                FaultKind::Hysteresis,
                FaultKind::Lag,
                FaultKind::AbsentAbove,
                FaultKind::AbsentBelow,
            ];
            for (place, kind) in kinds.iter().enumerate() {
                said[place] += u64::from(found.faults.iter().any(|one| one.kind == *kind));
            }
            said[5] += u64::from(found.correlations.iter().any(|one| one.is_certain()));
            said[6] += u64::from(found.returns.is_some());
            said[7] += u64::from(!found.tests.iter().all(|one| one.is_passed()));
            seeds.extend((!found.faults.is_empty()).then_some(seed));
            evidence.extend(found.faults.iter().map(|one| (one.kind, one.size, one.evidence)));
        }
        println!(
            "{kind}: of {count}: inverted {}, hysteresis {}, lag {}, above {}, below {}; shared noise {}, returns {}, not explained {}; {:.3} of {all} numbers within their errors",
            said[0],
            said[1],
            said[2],
            said[3],
            said[4],
            said[5],
            said[6],
            said[7],
            f64::from(within) / f64::from(all)
        );
        if std::env::var("FEWBITS_ALL").is_ok() {
            println!("  {evidence:.3?} {seeds:?}");
        }
    }
}
