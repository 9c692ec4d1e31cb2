//! The Rao-Blackwellised filter against the Kalman and the grid filter.

use fewbits_core::factor::{Constant, Levels, Scalar, Value};
use fewbits_core::{Cell, Gaussian, Link, Observed, Sign};
use fewbits_filters::{GaussianCloud, RaoBlackwellised, Resampling, ResamplingRule, Schedule, StateFilter, kalman};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{SVector, Vector2};

#[test]
fn with_values_only_it_is_the_kalman_filter() {
    let dynamics = constant_velocity_1d(1.0, 0.3).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.5), 2.0).unwrap();
    let mut exact = Gaussian::known(Vector2::new(0.0, 1.0)).unwrap();
    let mut ours = GaussianCloud::agreed(&exact, 3).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    let mut filter = RaoBlackwellised::new(ResamplingRule::default(), 3).unwrap();
    for k in 0..20 {
        let z = (k as f64 * 0.7).sin() * 5.0;
        let (next, info) = kalman::step(&dynamics, &sensor, &exact, &SVector::from([z])).unwrap();
        exact = next;
        let observed = Observed::new(sensor, Value::scalar(z, 2.0).unwrap());
        filter.predict(&mut rng, &dynamics, &mut ours).unwrap();
        let update = filter.update(&mut rng, &mut ours, &[&observed]).unwrap();
        assert!((update.log_likelihood - info.log_likelihood).abs() < 1e-9);
        assert!((ours.gaussian().mean() - exact.mean()).amax() < 1e-9);
        assert!((ours.gaussian().covariance() - exact.covariance()).amax() < 1e-9);
    }
}

#[test]
fn bits_cells_silence_and_loss_agree_with_the_grid() {
    let dynamics = Ar1::new(0.95, 0.5).unwrap();
    let sensor = LinearSensor::direct(0.49).unwrap();
    let cell = Cell::new(-1.0, 0.5).unwrap();
    let sign = |sign, threshold, crossover| {
        let link = Link::flipping(crossover).unwrap();
        Scalar::from(Levels::sign(sign, threshold, 0.49, &link).unwrap())
    };
    let silence = |loss| Scalar::from(Levels::silence(cell, 0.49, &Link::lossy(loss).unwrap()).unwrap());
    let sequence = [
        sign(Sign::Above, 0.4, 0.2),
        Levels::certain(Cell::new(1.0, 1.5).unwrap(), 0.49).unwrap().into(),
        silence(0.0),
        Constant::new(1.0).unwrap().into(),
        silence(0.3),
        sign(Sign::Below, 3.0, 0.0),
        Value::scalar(-0.3, 0.49).unwrap().into(),
        silence(0.1),
    ]
    .map(|factor| Observed::new(sensor, factor));
    let (exact, evidence) = crate::on_a_grid(&dynamics, [0.5, 2.0], &sequence);
    let (mut mean, mut variance, mut ratio) = <(Moments, Moments, Moments)>::default();
    let rule = ResamplingRule {
        resampling: Resampling::Systematic,
        schedule: Schedule::Below(0.5),
    };
    let mut filter = RaoBlackwellised::new(rule, 200).unwrap();
    for repeat in 0..60 {
        let mut rng = Stream::new(4).indexed(repeat).fast_rng();
        let mut ours = GaussianCloud::agreed(&Gaussian::scalar(0.5, 2.0).unwrap(), 200).unwrap();
        let mut total = 0.0;
        for observed in &sequence {
            filter.predict(&mut rng, &dynamics, &mut ours).unwrap();
            let info = filter.update(&mut rng, &mut ours, &[observed]);
            total += info.unwrap().log_likelihood;
        }
        mean.add(ours.gaussian().mean()[0]);
        variance.add(ours.gaussian().covariance()[(0, 0)]);
        ratio.add((total - evidence).exp());
    }
    for (name, ours, truth) in [
        ("mean", mean, exact.mean()),
        ("variance", variance, exact.variance()),
        ("evidence", ratio, 1.0),
    ] {
        let z = ours.estimate().z_score(truth);
        assert!(z.abs() < 4.5 && ours.standard_error() < 0.02, "{name}: {:?} against {truth}", ours.estimate());
    }
}
