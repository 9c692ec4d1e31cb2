//! Wild arguments: every step returns a belief of numbers or an error, and an error leaves the belief as it was.

use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_core::{Belief, Cell, Gaussian, Likelihood, LinearSensing, Link, Observed};
use fewbits_filters::{
    BootstrapFilter, GaussianCloud, Particles, PointMass, RaoBlackwellised, ResamplingRule, StateFilter,
    TransitionKernel, UniformGrid,
};
use fewbits_filters::{assumed_density, kalman};
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor, ReceivedPower};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1x3, Matrix2, Matrix3, SVector, Vector1, Vector2, Vector3};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(fewbits_core::laws::wild::number)
}

/// A caller's likelihood that may be anything.
struct Anything([f64; 2]);

impl<const D: usize> Likelihood<D> for Anything {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        if state[0] > 0.2 { self.0[0] } else { self.0[1] }
    }
}

fn finite<const D: usize>(belief: &Gaussian<D>) -> bool {
    belief.is_finite() && belief.covariance().diagonal().min() >= -1e-9 * belief.covariance().amax()
}

fn factors(x: &[f64]) -> Vec<Scalar> {
    let mut all: Vec<Scalar> = Vec::new();
    all.extend(Value::scalar(x[0], x[1]).map(Scalar::from));
    let link = Link::lossy(x[2]).unwrap_or(Link::PERFECT);
    if let Ok(cell) = Cell::new(x[0], x[3]) {
        all.extend(Levels::silence(cell, x[1], &link).map(Scalar::from));
        all.extend(Levels::outside(&cell, x[1], 1.0).map(Scalar::from));
    }
    all
}

proptest! {
    #[test]
    fn gaussian_filters_return_numbers_or_errors(x in prop::array::uniform16(wild())) {
        if let Ok(belief) = Gaussian::new(Vector2::new(x[0], x[1]), Matrix2::new(x[2], x[3], x[3], x[4])) {
            if let Ok(sensor) = LinearSensor::scalar(Vector2::new(x[5], x[6]), x[7]) {
                if let Ok((after, info)) = kalman::update(&sensor, &belief, &Vector1::new(x[8])) {
                    prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?}: {:?}", belief, sensor, after);
                }
                for factor in factors(&x[8..12]) {
                    if let Ok((after, info)) = assumed_density::update(&belief, sensor.matrix(), &factor) {
                        prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?} {:?}: {:?}", belief, sensor, factor, after);
                    }
                }
            }
            if let Ok(power) = ReceivedPower::<2>::new(Vector2::new(x[5], x[6]), [0, 1], x[7], x[12], x[13], x[14])
                && let Ok(value) = Value::scalar(x[8], x[14])
                && let Ok((after, info)) = assumed_density::update_through(&belief, &Observed::new(power, value))
            {
                prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?}: {:?}", belief, power, after);
            }
        }
    }
}

proptest! {
    // One case in 4 of `PROPTEST_CASES`: clouds and grids.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]
    #[test]
    fn clouds_and_grids_return_numbers_or_stay_as_they_were(x in prop::array::uniform8(wild())) {
        let start = Gaussian::scalar(0.1, 1.3).unwrap();
        let mut rng = Stream::new(2).rng();
        let before = Particles::from_belief(&mut rng, &start, 20).unwrap();
        let cloud_before = GaussianCloud::agreed(&start, 20).unwrap();
        let grid = UniformGrid::symmetric(6.0, 0.25).unwrap();
        let grid_before = PointMass::normal(grid, 0.1, 1.3).unwrap();
        let Ok(dynamics) = Ar1::new(x[6], x[7]).or_else(|_| Ar1::new(0.9, 0.5)) else { return Ok(()) };
        let sensor = LinearSensor::<1, 1>::direct(1.0).unwrap();
        let anything = Anything([x[4], x[5]]);
        let mut bootstrap = BootstrapFilter::new(ResamplingRule::default(), 20).unwrap();
        let mut imputing = RaoBlackwellised::new(ResamplingRule::default(), 20).unwrap();
        let mut belief = before.clone();
        match bootstrap.step_in_place(&mut rng, &dynamics, &mut belief, &[&anything]) {
            Ok(info) => prop_assert!(info.log_likelihood.is_finite() && belief.mean()[0].is_finite()),
            Err(_) => prop_assert_eq!(&belief, &before),
        }
        let mut density = grid_before.clone();
        match density.update(&anything) {
            Ok(log) => prop_assert!(log.is_finite() && density.mean().is_finite()),
            Err(_) => prop_assert_eq!(&density, &grid_before),
        }
        for factor in factors(&x[..4]) {
            let observed = Observed::new(sensor, factor);
            let mut belief = before.clone();
            match bootstrap.step_in_place(&mut rng, &dynamics, &mut belief, &[&observed]) {
                Ok(info) => prop_assert!(info.log_likelihood.is_finite() && belief.mean()[0].is_finite(), "{:?} {:?}", dynamics, observed),
                Err(_) => prop_assert_eq!(&belief, &before),
            }
            let mut cloud = cloud_before.clone();
            match imputing.update(&mut rng, &mut cloud, &[&observed]) {
                Ok(info) => prop_assert!(info.log_likelihood.is_finite() && cloud.gaussian().is_finite(), "{:?} {:?}", dynamics, observed),
                Err(_) => prop_assert_eq!(&cloud, &cloud_before),
            }
            let mut density = grid_before.clone();
            match density.update(&observed) {
                Ok(log) => prop_assert!(log.is_finite() && density.mean().is_finite()),
                Err(_) => prop_assert_eq!(&density, &grid_before),
            }
        }
        if let Ok(filter) = TransitionKernel::new(&dynamics, grid)
            && let Ok(predicted) = filter.predict(&grid_before)
        {
            prop_assert!(predicted.mean().is_finite() && predicted.variance().is_finite());
        }
    }
}

/// Defect: after a gap of a hundred years the covariance of a level with slope and curvature became indefinite, its bands were NaN, and
/// every later report was refused.
#[test]
fn reports_are_used_after_a_gap_of_any_length() {
    for gap in [1.0, 1e3, 1e6, 3.2e9, 1e12, 1e15] {
        let world = ContinuousLinear::nearly_constant_acceleration(1e-3).unwrap();
        let h = Matrix1x3::new(1.0, 0.0, 0.0);
        let start = Matrix3::from_diagonal(&Vector3::new(1.0, 0.1, 0.01));
        let mut belief = Gaussian::new(Vector3::new(0.0, 0.3, 0.1), start).unwrap();
        for k in 0..60 {
            let seconds = if k == 20 { gap } else { 1.0 };
            belief = assumed_density::predict(&world.over(seconds).unwrap(), &belief);
            // The level is 5 throughout.
            let report = Value::scalar(5.0, 0.25).unwrap();
            belief = assumed_density::update(&belief, &h, &report).unwrap().0;
            let variances = belief.covariance().diagonal();
            assert!(variances.iter().all(|v| *v > 0.0), "gap {gap}, {k}: {variances}");
            assert!(Gaussian::new(*belief.mean(), *belief.covariance()).is_ok(), "gap {gap}, {k}: {belief:?}");
            let off = (belief.mean()[0] - 5.0).abs() / variances[0].sqrt();
            assert!(k < 15 || off < 8.0, "gap {gap}, {k}: {off} deviations off");
        }
        let deviations = belief.covariance().diagonal().map(f64::sqrt);
        assert!(deviations[0] < 0.6 && deviations[1] < 1.0, "gap {gap}: {deviations}");
        assert!((belief.mean()[0] - 5.0).abs() < 1.0, "gap {gap}: {}", belief.mean());
    }
}
