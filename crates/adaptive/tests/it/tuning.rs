//! The choice of `delta` on recordings of an instrument that has steps of its own.

use super::common::mixed;
use fewbits_adaptive::{Config, Error, Receiver, Sensor, best_within, own_steps};
use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;

/// A random walk through a converter of `step` that writes `decimals`.
fn converted(step: f64, decimals: i32, n: usize) -> Vec<f64> {
    let (mut rng, mut x) = (Stream::new(3).rng(), 7.0);
    let ten = 10.0_f64.powi(decimals);
    (0..n)
        .map(|_| {
            x += 0.4 * step * rng.sample::<f64, _>(StandardNormal);
            ((x / step).round() * step * ten).round() / ten
        })
        .collect()
}

/// A step is found although the last decimal blurs it, in any unit; noise has none.
#[test]
fn steps_of_converters_are_found() {
    for (step, decimals, found) in [
        (0.0625, 4, 0.0625),
        (0.0625, 3, 0.0625),
        (0.01, 2, 0.01),
        (0.487_31, 3, 0.487_31),
    ] {
        let samples = converted(step, decimals, 3000);
        for unit in [1.0 / 4096.0, 1.0, 4096.0] {
            let scaled: Vec<f64> = samples.iter().map(|x| x * unit).collect();
            let steps = own_steps(&scaled);
            let near = |s: &f64| (s / unit - found).abs() < 1e-4 * found;
            assert!(steps.iter().any(near), "{step} in {unit}: {steps:?}");
        }
    }
    let mut rng = Stream::new(4).rng();
    let noise: Vec<f64> = (0..2000).map(|_| rng.sample(StandardNormal)).collect();
    let empty: [&[f64]; 4] = [&noise, &[], &[1.0], &[2.0, 2.0, 2.0]];
    assert!(empty.iter().all(|samples| own_steps(samples).is_empty()));
}

/// With the bits that a quantised signal is worth nothing is lost, to the last bit and at the receiver.
#[test]
fn a_converters_steps_return_exactly() {
    for (step, decimals) in [(0.0625, 4), (0.001, 3), (1.0, 0)] {
        let samples = converted(step, decimals, 2000);
        let (config, run) =
            best_within(Config::new(1.0).unwrap(), &samples, 2.0, |r| Ok::<_, Error>(r.rate())).unwrap();
        assert_eq!(config.resolution(), Some(step));
        assert_eq!(run.values, samples);
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        for x in &samples {
            let report = sensor.encode(*x).unwrap();
            let tracked = receiver.receive(&report.map(|r| r.packet).into()).unwrap();
            assert_eq!(tracked.value, Some(*x));
        }
    }
}

#[test]
fn units_do_not_matter() {
    let samples = mixed(2, 1500);
    let delta = |unit: f64| {
        let scaled: Vec<f64> = samples.iter().map(|x| x * unit).collect();
        let rate = |r: &fewbits_adaptive::Replay| Ok::<_, Error>(r.rate());
        best_within(Config::new(1.0).unwrap(), &scaled, 0.7, rate)
            .unwrap()
            .0
            .delta()
            / unit
    };
    for power in [-900, -40, 40, 900] {
        let ratio = delta(2.0_f64.powi(power)) / delta(1.0);
        assert!((0.7..1.4).contains(&ratio), "{power}: {ratio}");
    }
}

#[test]
fn hopeless_recordings_are_met_with_an_answer() {
    let rate = |r: &fewbits_adaptive::Replay| Ok::<_, Error>(r.rate());
    let any = Config::new(1.0).unwrap();
    for samples in [&[][..], &[3.0], &[3.0; 50], &[5e-324, 0.0, 5e-324]] {
        assert_eq!(best_within(any, samples, 0.1, rate).unwrap().0, any);
    }
    for bad in [
        &[f64::NAN, 1.0][..],
        &[f64::INFINITY, 1.0],
        &[f64::MAX, f64::MIN, 0.0],
        &[0.0, f64::NAN, 1.0],
    ] {
        assert!(best_within(any, bad, 0.1, rate).is_err(), "{bad:?}");
    }
    let (config, _) = best_within(any, &mixed(1, 300), 0.0, rate).unwrap();
    assert!(config.delta() > 1.0);
}
