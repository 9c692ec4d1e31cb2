//! Law of every filter: what is impossible is an error of one name, and leaves the belief as it was, to the last bit.

use fewbits_core::factor::{Constant, Levels, Scalar};
use fewbits_core::{Cell, Gaussian, Likelihood, LinearSensing, Observed};
use fewbits_filters::{
    BootstrapFilter, Error, GaussianCloud, Particles, PointMass, RaoBlackwellised, Resampling, ResamplingRule,
    Schedule, StateFilter, TransitionKernel, UniformGrid, assumed_density,
};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, SVector, Vector1, Vector2};

fn impossible<T: std::fmt::Debug>(result: Result<T, impl Into<Error>>) {
    let error = result.map_err(Into::into);
    assert!(matches!(error, Err(Error::Impossible)), "{error:?}");
}

fn no_number<T: std::fmt::Debug>(result: Result<T, impl Into<Error>>) {
    let error = result.map_err(Into::into);
    assert!(matches!(error, Err(Error::NotANumber { .. })), "{error:?}");
}

fn direct<const D: usize>() -> LinearSensor<D, 1> {
    LinearSensor::scalar(SVector::from_fn(|d, _| f64::from(u8::from(d == 0))), 1.0).unwrap()
}

/// Impossible everywhere: as a constant, and as a cell that no number reaches.
fn nevers<const D: usize>() -> [Observed<LinearSensor<D, 1>, Scalar, 1>; 2] {
    let cell = Cell::new(1e200, 2e200).unwrap();
    [
        Observed::new(direct(), Constant::new(0.0).unwrap().into()),
        Observed::new(direct(), Levels::certain(cell, 1.0).unwrap().into()),
    ]
}

/// Weighted, so that resampling would show.
fn cloud() -> Particles<1> {
    let logs: Vec<f64> = (0..50).map(|i| -0.1 * f64::from(i)).collect();
    Particles::new([(0..50).map(f64::from).collect()], &logs)
        .unwrap()
        .with_auxiliary((0..100).map(f64::from).collect())
        .unwrap()
}

#[test]
fn particle_filters() {
    struct NotANumber;
    impl Likelihood<1> for NotANumber {
        fn log_likelihood(&self, state: &Vector1<f64>) -> f64 {
            if state[0] > 10.0 { f64::NAN } else { 0.0 }
        }
    }
    let dynamics = Ar1::new(0.9, 1.0).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    let before = cloud();
    let mut belief = before.clone();
    for schedule in [Schedule::Always, Schedule::Below(0.9), Schedule::Never] {
        let rule = ResamplingRule {
            resampling: Resampling::Systematic,
            schedule,
        };
        let mut filter = BootstrapFilter::new(rule, before.len()).unwrap();
        for never in &nevers::<1>() {
            impossible(filter.update(&mut rng, &mut belief, &[never]));
            impossible(filter.step_in_place(&mut rng, &dynamics, &mut belief, &[never]));
        }
        no_number(filter.update(&mut rng, &mut belief, &[&NotANumber]));
        assert_eq!(belief, before);
        assert_eq!(belief.weights(), before.weights());
        assert_eq!(belief.effective_sample_size(), before.effective_sample_size());
    }
}

#[test]
fn the_rao_blackwellised_filter() {
    let mut rng = Stream::new(1).fast_rng();
    let before = GaussianCloud::new(cloud(), [[2.0]].into()).unwrap();
    let mut belief = before.clone();
    let rule = ResamplingRule {
        resampling: Resampling::Systematic,
        schedule: Schedule::Below(0.9),
    };
    let mut filter = RaoBlackwellised::new(rule, 100).unwrap();
    for never in &nevers::<1>() {
        impossible(filter.update(&mut rng, &mut belief, &[never]));
        assert_eq!(belief, before);
        assert_eq!(belief.means.weights(), before.means.weights());
    }
}

#[test]
fn the_grid_filters() {
    let grid = UniformGrid::symmetric(10.0, 0.25).unwrap();
    let filter = TransitionKernel::new(&Ar1::new(0.9, 1.0).unwrap(), grid).unwrap();
    let before = PointMass::normal(grid, 0.3, 2.0).unwrap();
    let mut belief = before.clone();
    for never in &nevers::<1>() {
        impossible(filter.predict(&belief).and_then(|mut next| next.update(never)));
        impossible(belief.update(never));
    }
    no_number(belief.update_with(|_| f64::NAN));
    no_number(belief.update_with(|x| if x > 1.0 { f64::NAN } else { 0.0 }));
    no_number(belief.reweight(&vec![f64::NAN; grid.points()]));
    impossible(belief.reweight(&vec![0.0; grid.points()]));
    assert_eq!(belief, before);
}

#[test]
fn the_assumed_density_filter() {
    let belief = Gaussian::new(Vector2::new(1.0, 0.0), Matrix2::identity()).unwrap();
    for never in &nevers::<2>() {
        impossible(assumed_density::update(&belief, never.sensing.matrix(), &never.factor));
        impossible(assumed_density::update_through(&belief, never));
    }
}
