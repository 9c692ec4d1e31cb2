//! Fixed-lag smoothing in the centre against the joint normal law of all instants, and moves by a known input.

use crate::centre::{noise, slot};
use fewbits_core::{FullValue, Gaussian, Link};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_models::{AffineGaussian, ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{DMatrix, DVector, Matrix1, Vector1};
use rand::Rng;

const CHANGE: f64 = 0.3;
const NOISE: f64 = 0.7;

fn centre(rng: &mut dyn Rng) -> FusionCentre<1, MomentFilter> {
    let world = ContinuousLinear::random_walk(CHANGE).unwrap();
    let prior = Gaussian::scalar(1.0, 2.0).unwrap();
    let mut centre = FusionCentre::new(rng, world, MomentFilter, &prior).unwrap();
    let sensing = LinearSensor::direct(NOISE).unwrap();
    centre
        .join(0, Reporting::values(sensing, FullValue::new(NOISE).unwrap(), Link::PERFECT))
        .unwrap();
    centre
}

#[test]
fn the_window_is_smoothed_as_the_joint_law_says() {
    let mut rng = Stream::new(5).rng();
    let mut centre = centre(&mut rng).with_window(1e3).unwrap();
    let times = [0.5, 1.0, 2.5, 2.75, 6.0, 7.0];
    let values: Vec<f64> = times.iter().map(|_| 1.0 + noise(&mut rng)).collect();
    for (time, value) in times.iter().zip(&values) {
        centre.advance(&mut rng, *time).unwrap();
        centre.receive(&mut rng, &[slot(0, *value)]).unwrap();
    }
    let now = 8.5;
    centre.advance(&mut rng, now).unwrap();
    let before = centre.estimate();
    let found = centre.smoothed(&mut rng).unwrap();
    assert_eq!(centre.estimate(), before);
    // The level at all instants is normal; the values are it with noise.
    let all: Vec<f64> = times.iter().copied().chain([now]).collect();
    let n = times.len();
    let prior = DMatrix::from_fn(n + 1, n + 1, |i, j| 2.0 + CHANGE * all[i].min(all[j]));
    let seen = prior.columns(0, n).into_owned();
    let innovation = prior.view((0, 0), (n, n)) + DMatrix::identity(n, n) * NOISE;
    let gain = innovation.cholesky().unwrap().solve(&seen.transpose()).transpose();
    let off = DVector::from_fn(n, |i, _| values[i] - 1.0);
    let mean = &gain * off;
    let covariance = &prior - &gain * seen.transpose();
    assert_eq!(found.len(), n + 1);
    for (k, (time, belief)) in found.iter().enumerate() {
        assert_eq!(*time, all[k]);
        let (expected, variance) = (1.0 + mean[k], covariance[(k, k)]);
        assert!((belief.mean()[0] - expected).abs() < 1e-10, "{k}: {belief:?} {expected}");
        assert!((belief.covariance()[0] - variance).abs() < 1e-10, "{k}: {belief:?} {variance}");
    }
}

#[test]
fn a_known_input_moves_the_belief() {
    let mut rng = Stream::new(6).rng();
    let mut centre = centre(&mut rng).with_window(1e3).unwrap();
    let driven = AffineGaussian::new(Matrix1::new(1.0), Vector1::new(5.0), Matrix1::new(0.01)).unwrap();
    centre.advance_by(&mut rng, 2.0, &driven).unwrap();
    assert_eq!((centre.time(), centre.estimate().mean()[0]), (2.0, 6.0));
    assert!((centre.estimate().covariance()[0] - 2.01).abs() < 1e-12);
    // The stretch is known to no late report.
    assert!(!centre.late(&mut rng, 1.0, &[slot(0, 0.0)]).unwrap());
    assert_eq!(centre.smoothed(&mut rng).unwrap().len(), 1);
    let before = centre.estimate();
    assert!(centre.advance_by(&mut rng, 2.0, &driven).is_err());
    assert_eq!((centre.time(), centre.estimate()), (2.0, before));
}
