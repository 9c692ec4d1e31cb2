//! The sensor's halves of `fewbits-node` decide and remember as the schemes here.

use fewbits_cfwmd::no_feedback::LocalSensor;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{Gaussian, LinearDynamics, LinearSensing, NumberFormat};
use fewbits_models::{LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use fewbits_node::censor::{OwnFilter, half_width};
use nalgebra::{Matrix2, SVector, Vector1, Vector2};
use rand::RngExt;

fn sensor() -> LinearSensor<2, 1> {
    LinearSensor::scalar(Vector2::new(1.0, 0.25), 0.3).unwrap()
}

#[test]
fn own_filter_is_that_of_a_local_sensor_to_the_bit() {
    let dynamics = constant_velocity_1d(1.0, 0.5).unwrap();
    let start = Gaussian::new(Vector2::new(0.3, 1.0), Matrix2::identity()).unwrap();
    let mut local = LocalSensor::new(sensor(), 0.45, NumberFormat::Double, &start).unwrap();
    let (f, h) = (dynamics.transition(), sensor());
    let rows = [[f[(0, 0)], f[(0, 1)]], [f[(1, 0)], f[(1, 1)]]];
    let row = [h.matrix()[(0, 0)], h.matrix()[(0, 1)]];
    let mut node = OwnFilter::new(rows, row, (*start.mean()).into()).unwrap();
    let mut recursion = OwnRecursion::new(&start);
    let mut rng = Stream::new(3).rng();
    let mut reports = 0;
    for n in 0..500 {
        let z = 0.9 * f64::from(n) + 4.0 * rng.random::<f64>();
        let step = recursion.advance(&dynamics, &h, &SVector::zeros()).unwrap();
        let rule = CensoringRule::new(&step.innovation_covariance, 0.45).unwrap();
        let report = local.step(&dynamics, &Vector1::new(z)).unwrap();
        let gain: [f64; 2] = step.gain.into();
        assert_eq!(node.speaks(z, &gain, rule.half_width()).unwrap(), report.is_some(), "slot {n}");
        assert_eq!(*node.estimate(), <[f64; 2]>::from(*local.estimate()), "slot {n}");
        reports += u32::from(report.is_some());
    }
    assert!((50..450).contains(&reports), "{reports}");
}

#[test]
fn told_half_width_is_that_of_covariance_feedback_to_the_bit() {
    let scheme = CovarianceFeedback::new(sensor(), 1.7, NumberFormat::Double).unwrap();
    let mut rng = Stream::new(4).rng();
    for _ in 0..500 {
        let (a, b, d) = (1.0 + rng.random::<f64>(), rng.random::<f64>(), 1.0 + 9.0 * rng.random::<f64>());
        let told = Gaussian::new(Vector2::zeros(), Matrix2::new(a, b, b, d)).unwrap();
        let width = half_width(&[1.0, 0.25], &[[a, b], [b, d]], 0.3, 1.7).unwrap();
        assert_eq!(width, scheme.under(&told).unwrap().rule().half_width());
    }
}
