//! The Rao-Blackwellised filter against the Kalman and the grid filter.

use fewbits_core::likelihood::{Heard, ScalarLikelihood};
use fewbits_core::message::{Cell, Sign};
use fewbits_core::{Gaussian, Likelihood};
use fewbits_filters::{
    Error, Grid, ParticleFilter, PointMass, PointMassFilter, RaoBlackwellised, Resampling, Schedule, Workspace, kalman,
};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{SVector, Vector2};

#[test]
fn with_values_only_it_is_the_kalman_filter() {
    let dynamics = constant_velocity_1d(1.0, 0.3).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.5), 2.0).unwrap();
    let mut exact = Gaussian::known(Vector2::new(0.0, 1.0)).unwrap();
    let mut ours = RaoBlackwellised::new(&exact, 3).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    let (filter, mut workspace) = (ParticleFilter::default(), Workspace::default());
    for k in 0..20 {
        let z = (k as f64 * 0.7).sin() * 5.0;
        let (next, info) = kalman::step(&dynamics, &sensor, &exact, &SVector::from([z])).unwrap();
        exact = next;
        ours.predict(&mut rng, &filter, &dynamics, &mut workspace).unwrap();
        let heard = ours.update(&mut rng, &sensor, &Heard::Value(z)).unwrap();
        assert!((heard.log_likelihood - info.log_likelihood).abs() < 1e-9);
        assert!((ours.gaussian().mean() - exact.mean()).amax() < 1e-9);
        assert!((ours.gaussian().covariance() - exact.covariance()).amax() < 1e-9);
    }
}

#[test]
fn bits_cells_silence_and_loss_agree_with_the_grid() {
    let dynamics = Ar1::new(0.95, 0.5).unwrap();
    let sensor = LinearSensor::direct(0.49).unwrap();
    let cell = Cell::new(-1.0, 0.5).unwrap();
    let sequence = [
        Heard::Bit {
            sign: Sign::Above,
            threshold: 0.4,
            crossover: 0.2,
        },
        Heard::Cell(Cell::new(1.0, 1.5).unwrap()),
        Heard::Silence { cell, loss: 0.0 },
        Heard::Lost,
        Heard::Silence { cell, loss: 0.3 },
        Heard::Bit {
            sign: Sign::Below,
            threshold: 3.0,
            crossover: 0.0,
        },
        Heard::Value(-0.3),
        Heard::Silence { cell, loss: 0.1 },
    ];
    let grid = Grid::new(-12.0, 12.0, 0.02).unwrap();
    let referee = PointMassFilter::new(&dynamics, grid).unwrap();
    let mut exact = PointMass::normal(grid, 0.5, 2.0).unwrap();
    let mut evidence = 0.0;
    for heard in sequence {
        let likelihood = ScalarLikelihood::new(SVector::from([1.0]), 0.7, heard).unwrap();
        exact = referee.predict(&exact).unwrap();
        evidence += exact
            .update(|x| likelihood.log_likelihood(&SVector::from([x])))
            .unwrap();
    }
    let (mut mean, mut variance, mut ratio) = <(Moments, Moments, Moments)>::default();
    let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Below(0.5));
    for repeat in 0..60 {
        let mut rng = Stream::new(4).indexed(repeat).fast_rng();
        let mut workspace = Workspace::default();
        let mut ours = RaoBlackwellised::new(&Gaussian::scalar(0.5, 2.0).unwrap(), 200).unwrap();
        let mut total = 0.0;
        for heard in sequence {
            ours.predict(&mut rng, &filter, &dynamics, &mut workspace).unwrap();
            total += ours.update(&mut rng, &sensor, &heard).unwrap().log_likelihood;
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

#[test]
fn bad_messages_leave_the_belief() {
    let sensor = LinearSensor::direct(0.5).unwrap();
    let mut belief = RaoBlackwellised::new(&Gaussian::scalar(0.0, 1.0).unwrap(), 10).unwrap();
    let before = belief.clone();
    let mut rng = Stream::new(4).fast_rng();
    for bad in [
        Heard::Value(f64::NAN),
        Heard::Bit {
            sign: Sign::Above,
            threshold: f64::NAN,
            crossover: 0.0,
        },
        Heard::Bit {
            sign: Sign::Above,
            threshold: 0.0,
            crossover: 0.7,
        },
        Heard::Silence {
            cell: Cell::new(0.0, 1.0).unwrap(),
            loss: 1.0,
        },
    ] {
        assert!(matches!(belief.update(&mut rng, &sensor, &bad), Err(Error::Argument(_))), "{bad:?}");
        assert_eq!(belief, before);
    }
    assert!(RaoBlackwellised::new(&Gaussian::scalar(0.0, 1.0).unwrap(), 0).is_err());
}
