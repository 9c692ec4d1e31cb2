//! The filter of vector states against Kalman filters, assumed-density updates and the scalar filters.

use super::SignFilter;
use fewbits_core::{Gaussian, LinearSensing, Link, Observation, Scheme, Sign};
use fewbits_dymbo::{CountFusion, DymboFilter, Error, ParallelFilter, ScalarFilter, ScalarPlant, SignBit};
use fewbits_filters::{assumed_density, kalman};
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, ScalarSensor};
use nalgebra::{Matrix2, SMatrix, Vector1, Vector2};
use proptest::prelude::*;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

const ABOVE: Observation<Sign> = Observation::Received(Sign::Above);
const BELOW: Observation<Sign> = Observation::Received(Sign::Below);

fn belief() -> Gaussian<2> {
    Gaussian::new(Vector2::new(0.3, -1.0), Matrix2::new(2.0, 0.5, 0.5, 1.0)).unwrap()
}

fn dynamics() -> LinearGaussian<2, 2> {
    LinearGaussian::with_covariance(Matrix2::new(0.95, 0.25, -0.1, 0.9), Matrix2::identity() * 0.3).unwrap()
}

proptest! {
    /// The closed form of the paper's vector recursion, to 1e-13 relative.
    #[test]
    fn a_bit_at_the_prediction_is_the_closed_form(
        h in prop::array::uniform2(-2.0..2.0_f64), r in 0.1..3.0_f64, a in 0.1..3.0_f64, b in 0.1..3.0_f64, rho in -0.95..0.95_f64,
        above in any::<bool>(), scale in prop::sample::select(vec![1e-4, 1.0, 1e4]),
    ) {
        let unit = scale * scale;
        let c = rho * (a * b).sqrt();
        let prior = Gaussian::new(Vector2::new(0.3, -1.0) * scale, Matrix2::new(a, c, c, b) * unit).unwrap();
        let sensor = ScalarSensor::scalar(Vector2::from(h), r * unit).unwrap();
        let filter = SignFilter::new(dynamics(), [sensor]);
        let (posterior, info) = filter.update(&prior, 0, if above { &ABOVE } else { &BELOW }).unwrap();
        let h = Vector2::from(h);
        let s = ((h.transpose() * prior.covariance() * h)[0] + r * unit).sqrt();
        let step = prior.covariance() * h * ((FRAC_2_PI).sqrt() / s);
        let sign = if above { 1.0 } else { -1.0 };
        let expected = prior.covariance() - step * step.transpose();
        prop_assert!((posterior.mean() - prior.mean() - step * sign).amax() <= 1e-13 * scale);
        prop_assert!((posterior.covariance() - expected).amax() <= 1e-13 * prior.covariance().amax());
        prop_assert!((info.log_likelihood - 0.5_f64.ln()).abs() < 1e-12 && info.bits == 1);
        // The general update, over a link that loses and inverts.
        let filter = filter.with_link(Link::new(0.2, 0.1).unwrap());
        let bit = if above { &ABOVE } else { &BELOW };
        let (closed, one) = filter.update(&prior, 0, bit).unwrap();
        let factor = SignBit::new(r * unit).unwrap().factor(&filter.threshold(&prior, 0).unwrap(), bit, &filter.link).unwrap();
        let (general, same) = assumed_density::update(&prior, sensor.matrix(), &factor).unwrap();
        prop_assert!((closed.mean() - general.mean()).amax() <= 1e-13 * scale);
        prop_assert!((closed.covariance() - general.covariance()).amax() <= 1e-13 * prior.covariance().amax());
        prop_assert!((one.log_likelihood - same.log_likelihood).abs() < 1e-12);
    }
}

#[test]
fn in_one_dimension_it_is_the_scalar_filter() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.2).unwrap();
    let predicted = Gaussian::scalar(0.7, 1.4).unwrap();
    for link in [Link::PERFECT, Link::new(0.2, 0.1).unwrap()] {
        let (scalar, one) = DymboFilter::new(plant)
            .with_link(link)
            .update(&predicted, &BELOW)
            .unwrap();
        let filter = SignFilter::new(*plant.dynamics(), [*plant.sensor()]).with_link(link);
        let (vector, same) = filter.update(&predicted, 0, &BELOW).unwrap();
        assert!((scalar.mean() - vector.mean()).amax() < 1e-14);
        assert!((scalar.covariance() - vector.covariance()).amax() < 1e-14);
        assert!((one.log_likelihood - same.log_likelihood).abs() < 1e-14);
    }
}

#[test]
fn a_bit_at_the_prediction_is_a_kalman_step_with_inflated_noise() {
    let sensor = ScalarSensor::scalar(Vector2::new(1.0, -0.5), 0.8).unwrap();
    let seen = (sensor.matrix() * belief().covariance() * sensor.matrix().transpose())[0];
    let equivalent = LinearSensor::scalar(sensor.direction(), FRAC_PI_2 * (seen + 0.8) - seen).unwrap();
    let analog = kalman::update(&equivalent, &belief(), &Vector1::zeros()).unwrap().0;
    // What a sensor cannot see does not move.
    let blind = ScalarSensor::scalar(Vector2::zeros(), 1.0).unwrap();
    let filter = SignFilter::new(dynamics(), [sensor, blind]);
    let bit = filter.update(&belief(), 0, &ABOVE).unwrap().0;
    assert!((bit.covariance() - analog.covariance()).amax() < 1e-14);
    assert_eq!(filter.update(&belief(), 1, &ABOVE).unwrap().0, belief());
}

/// Regression: an index beyond the sensors was a panic.
/// Defect: where the prediction's variance is 1e16 times the noise the covariance of the bits is singular, and the update failed.
#[test]
fn parallel_bits_of_nearly_noiseless_sensors_are_one_bit() {
    let sensor = |h: [f64; 2]| ScalarSensor::scalar(h.into(), 1.0).unwrap();
    let wide = Gaussian::new(Vector2::new(0.0, 1.0), SMatrix::<f64, 2, 2>::identity() * 1e16).unwrap();
    let [one, two] = [sensor([1.0, 0.0]), sensor([0.6, 0.8])];
    let same = SignFilter::new(dynamics(), [one, one]);
    let (both, info) = same.update_parallel(&wide, &[ABOVE, ABOVE]).unwrap();
    let (alone, _) = SignFilter::new(dynamics(), [one])
        .update_parallel(&wide, &[ABOVE])
        .unwrap();
    assert!((both.mean() - alone.mean()).amax() < 1e-6 * alone.mean().amax());
    assert!((both.covariance() - alone.covariance()).amax() < 1e-6 * 1e16 && info.bits == 2);
    let three = SignFilter::new(dynamics(), [one, one, two]);
    let (after, _) = three.update_parallel(&wide, &[ABOVE, ABOVE, BELOW]).unwrap();
    assert!(Gaussian::new(*after.mean(), *after.covariance()).is_ok());
}

#[test]
fn refuses_sensors_that_are_not_there() {
    let filter = SignFilter::new(dynamics(), [ScalarSensor::scalar(Vector2::new(1.0, 0.5), 1.0).unwrap()]);
    assert!(matches!(filter.threshold(&belief(), 1), Err(Error::Argument(_))));
    assert!(matches!(filter.update(&belief(), 1, &ABOVE), Err(Error::Argument(_))));
    assert_eq!(filter.update(&belief(), 0, &Observation::Nothing), Err(Error::Impossible));
}

#[test]
fn parallel_fusion_of_one_or_no_sensor() {
    let sensor = ScalarSensor::scalar(Vector2::new(1.0, 0.5), 1.0).unwrap();
    let filter = SignFilter::new(dynamics(), [sensor]).with_link(Link::flipping(0.1).unwrap());
    let (parallel, both) = filter.update_parallel(&belief(), &[BELOW]).unwrap();
    let (sequential, one) = filter.update(&belief(), 0, &BELOW).unwrap();
    assert!((parallel.mean() - sequential.mean()).amax() < 1e-14 && both == one);
    assert!((parallel.covariance() - sequential.covariance()).amax() < 1e-14);
    // A sensor whose bit is lost might as well not be there.
    let two = SignFilter::new(dynamics(), [sensor; 2]).with_link(Link::flipping(0.1).unwrap());
    let (without, _) = two.update_parallel(&belief(), &[Observation::Lost, BELOW]).unwrap();
    assert!((without.mean() - parallel.mean()).amax() < 1e-14);
    assert!((without.covariance() - parallel.covariance()).amax() < 1e-14);
    let blind = SignFilter::new(dynamics(), []);
    assert_eq!(blind.update_parallel(&belief(), &[]).unwrap().0, belief());
    let alone = blind.sequential_steady_state().unwrap();
    assert!((alone.filtered_covariance - dynamics().stationary_covariance().unwrap()).amax() < 1e-11);
}

#[test]
fn identical_sensors_in_parallel_are_the_scalar_count() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
    let link = Link::flipping(0.05).unwrap();
    let filter = SignFilter::new(Ar1::new(0.9, 0.5).unwrap(), [*plant.sensor(); 3]).with_link(link);
    let count = ParallelFilter::new(plant, 3, CountFusion::Linear)
        .unwrap()
        .with_link(link);
    let predicted = Gaussian::scalar(0.0, 1.1).unwrap();
    let (both, _) = filter.update_parallel(&predicted, &[ABOVE, ABOVE, BELOW]).unwrap();
    let (corrections, variance) = count.table(1.1);
    assert!((both.mean()[0] - corrections[2]).abs() < 1e-13 && (both.covariance()[0] - variance).abs() < 1e-13);
    let stuck = Gaussian::from_trusted_parts(Vector1::zeros(), SMatrix::<f64, 1, 1>::from([[f64::NAN]]));
    assert!(filter.update_parallel(&stuck, &[ABOVE; 3]).is_err());
}
