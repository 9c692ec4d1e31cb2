//! Every reconstruction is within delta, whatever finite samples come.

use super::common::mixed;
use fewbits_adaptive::{Config, Receiver, Sensor};
use proptest::prelude::*;

fn check(config: Config, samples: &[f64]) -> usize {
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let mut bits = 0;
    for sample in samples {
        let report = sensor.encode(*sample).unwrap();
        bits += report.map_or(0, |report| report.packet.bits());
        let tracked = receiver.receive(&report.map(|report| report.packet).into()).unwrap();
        let value = tracked.value.unwrap();
        assert_eq!(Some(value), sensor.reconstruction());
        let straight = value - sample;
        let error = config.period().map_or(straight.abs(), |period| {
            let wrapped = (value - sample.rem_euclid(period)).abs();
            wrapped.min((period - wrapped).abs())
        });
        assert!(error <= config.delta(), "{sample}: {value}");
    }
    bits
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        2 => (-300..300_i32, -1.0..1.0_f64).prop_map(|(e, m)| m * 10.0_f64.powi(e)),
        1 => prop_oneof![Just(0.0), Just(-0.0), Just(f64::MAX), Just(f64::MIN), Just(5e-324), Just(1e300), Just(1e-300)],
        2 => (-50..50_i32).prop_map(|i| f64::from(i) * 0.25),
    ]
}

proptest! {
    // One case in 4 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    #[test]
    fn any_finite_samples(samples in prop::collection::vec(wild(), 1..120), exponent in -300..300_i32, near in any::<bool>()) {
        let delta = if near { 0.125 } else { 10.0_f64.powi(exponent) };
        check(Config::new(delta).unwrap(), &samples);
        check(Config::exact(2.0 * delta).unwrap(), &samples);
    }

    #[test]
    fn any_circle(samples in prop::collection::vec(wild(), 1..60), delta in 0.001..400.0_f64) {
        check(Config::new(delta).unwrap().circular(360.0).unwrap(), &samples);
    }

    #[test]
    fn recorded_traits(seed in any::<u64>(), delta in 0.001..10.0_f64) {
        check(Config::new(delta).unwrap(), &mixed(seed, 600));
    }
}

#[test]
fn shapes_and_units() {
    for unit in [1e-300, 1e-4, 1.0, 1e4, 1e290] {
        type Shape = fn(f64) -> f64;
        let shapes: [(&str, Shape, usize); 5] = [
            ("constant", |_| 7.3, 80),
            ("ramp", |n| 0.37 * n, 400),
            ("square", |n| if (n / 50.0) % 2.0 < 1.0 { 0.0 } else { 1e3 }, 700),
            ("far square", |n| if (n / 50.0) % 2.0 < 1.0 { 0.0 } else { 1e9 }, 2400),
            ("spikes", |n| if n % 100.0 == 99.0 { 1e5 } else { 0.1 }, 2400),
        ];
        for (name, shape, most) in shapes {
            let samples: Vec<f64> = (0..2000).map(|n| unit * shape(f64::from(n))).collect();
            let bits = check(Config::new(unit).unwrap(), &samples);
            assert!(bits <= most, "{name} at {unit}: {bits} bits");
        }
    }
}

/// The same signal in other units costs the same bits, where the units are powers of two.
#[test]
fn nothing_depends_on_the_unit() {
    let samples = mixed(5, 2000);
    let bits = |unit: f64| {
        let mut sensor = Sensor::new(Config::new(0.05 * unit).unwrap());
        let reports: Vec<_> = samples.iter().map(|x| sensor.encode(x * unit).unwrap()).collect();
        reports
            .iter()
            .skip(1)
            .map(|r| r.map_or(0.0, |r| r.information))
            .sum::<f64>()
    };
    let unit = bits(1.0);
    for power in [-40, -13, 13, 40] {
        assert_eq!(bits(2.0_f64.powi(power)), unit);
    }
}

#[test]
fn circles_cost_nothing_where_they_close() {
    let samples: Vec<f64> = (0..4000)
        .map(|n| (350.0 + 0.9 * f64::from(n)).rem_euclid(360.0))
        .collect();
    let round = check(Config::new(2.0).unwrap().circular(360.0).unwrap(), &samples);
    let straight = check(Config::new(2.0).unwrap(), &samples);
    assert!(round < straight, "{round} {straight}");
}

#[test]
fn refused_samples_leave_everything_as_it_was() {
    let mut sensor = Sensor::new(Config::new(0.1).unwrap());
    for x in mixed(1, 50) {
        sensor.encode(x).unwrap();
    }
    let before = sensor.clone();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(sensor.encode(bad).unwrap_err().to_string().contains("sample"));
    }
    assert!(sensor.encode_after(0, 1.0).is_err());
    assert_eq!(sensor, before);
    for bad in [0.0, -1.0, f64::NAN, f64::MAX] {
        assert!(Config::new(bad).is_err());
    }
    assert!(Config::new(1e-14).unwrap().circular(360.0).is_err());
}
