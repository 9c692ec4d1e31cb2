//! Vector states: the sign-of-innovations filter.
//!
//! A bit of the sign of `x - h' prediction` moves the estimate along `P h`. It does what a Kalman step does whose noise
//! variance is `(pi/2)(h'Ph + sigma^2) - h'Ph`, so the covariance stays positive definite. Several sensors of a slot speak one
//! after the other, each against the refreshed prediction, or all at once.

use crate::update::UpdateInfo;
use crate::{Error, bit_update};
use fewbits_core::{Gaussian, LinearDynamics, Sign};
use fewbits_filters::{SteadyState, kalman};
use fewbits_models::ScalarSensor;
use fewbits_numerics::error::finite;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::SQRT_2_OVER_PI;
use nalgebra::{Cholesky, SMatrix, SVector};
use std::f64::consts::FRAC_2_PI;

/// Corrects a predicted belief with a sign bit of one sensor whose threshold was its prediction `h' mean`:
/// `mean + b sqrt(2/pi) P h/s`, `P - (2/pi) P h h' P/s^2` with `s^2 = h'Ph + sigma^2`.
#[inline]
pub fn sign_update<const D: usize>(predicted: &Gaussian<D>, sensor: &ScalarSensor<D>, bit: Sign) -> Gaussian<D> {
    let (cross, variance) = innovation(predicted, sensor);
    let scale = SQRT_2_OVER_PI / variance.sqrt();
    let step = cross * scale;
    Gaussian::from_trusted_parts(
        predicted.mean() + step * bit.value(),
        predicted.covariance() - step * step.transpose(),
    )
}

/// `P h` and the innovation variance `h'Ph + sigma^2`.
#[inline]
fn innovation<const D: usize>(belief: &Gaussian<D>, sensor: &ScalarSensor<D>) -> (SVector<f64, D>, f64) {
    let direction = sensor.direction();
    let cross = belief.covariance() * direction;
    (cross, direction.dot(&cross) + sensor.noise_variance())
}

/// The exact moments for any threshold and a known crossover, as [`bit_update`] along `h`.
///
/// # Errors
/// As [`bit_update`].
pub fn vector_bit_update<const D: usize>(
    prior: &Gaussian<D>,
    sensor: &ScalarSensor<D>,
    bit: Sign,
    threshold: f64,
    crossover: f64,
) -> Result<(Gaussian<D>, UpdateInfo), Error> {
    let (cross, total) = innovation(prior, sensor);
    let seen = total - sensor.noise_variance();
    let line = Gaussian::scalar(finite("mean", sensor.direction().dot(prior.mean()))?, seen.max(0.0))?;
    let (posterior, info) = bit_update(&line, sensor.noise_variance(), bit, threshold, crossover)?;
    if seen <= 0.0 {
        return Ok((*prior, info));
    }
    // Everything that the bit says about x, it says about h'x.
    let shift = posterior.mean()[0] - line.mean()[0];
    let mean = prior.mean() + cross * (shift / seen);
    let covariance = prior.covariance() - cross * cross.transpose() * (info.information / total);
    Ok((Gaussian::from_trusted_parts(mean, covariance), info))
}

/// The filter for `M` one-bit sensors of a `D`-dimensional linear system.
///
/// ```
/// use fewbits_core::{Encoder, Gaussian};
/// use fewbits_dymbo::{vector::SignFilter, OneBitSensor};
/// use fewbits_models::{constant_velocity_1d, ScalarSensor};
/// let position = ScalarSensor::scalar([1.0, 0.0].into(), 1.0)?;
/// let filter = SignFilter::new(constant_velocity_1d(1.0, 0.1)?, [position]);
/// let mut belief = Gaussian::new([0.0, 1.0].into(), nalgebra::Matrix2::identity())?;
/// for sample in [1.1, 2.3, 2.9] {
///     belief = filter.predict(&belief);
///     let bit = OneBitSensor.encode(&sample, &filter.threshold(&belief, 0));
///     belief = filter.update(&belief, 0, bit);
/// }
/// assert!((belief.mean()[0] - 3.0).abs() < 1.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SignFilter<F, const D: usize, const M: usize> {
    dynamics: F,
    sensors: [ScalarSensor<D>; M],
}

impl<F: LinearDynamics<D>, const D: usize, const M: usize> SignFilter<F, D, M> {
    /// The filter for these dynamics and sensors; without sensors it only predicts.
    pub fn new(dynamics: F, sensors: [ScalarSensor<D>; M]) -> Self {
        Self { dynamics, sensors }
    }

    /// The dynamics.
    pub fn dynamics(&self) -> &F {
        &self.dynamics
    }

    /// The sensors.
    pub fn sensors(&self) -> &[ScalarSensor<D>; M] {
        &self.sensors
    }

    /// Time update.
    #[inline]
    pub fn predict(&self, belief: &Gaussian<D>) -> Gaussian<D> {
        kalman::predict(&self.dynamics, belief)
    }

    /// The threshold to broadcast to a sensor: its predicted measurement under the belief so far.
    ///
    /// # Panics
    /// If `sensor >= M`, as indexing does.
    #[inline]
    pub fn threshold(&self, predicted: &Gaussian<D>, sensor: usize) -> f64 {
        self.sensors[sensor].direction().dot(predicted.mean())
    }

    /// Corrects with the bit of one sensor, whose threshold was [`SignFilter::threshold`] of this very belief.
    ///
    /// # Panics
    /// If `sensor >= M`, as indexing does.
    #[inline]
    pub fn update(&self, predicted: &Gaussian<D>, sensor: usize, bit: Sign) -> Gaussian<D> {
        sign_update(predicted, &self.sensors[sensor], bit)
    }

    /// Corrects with the bits of all sensors, whose thresholds were those of this belief: the best linear function of the
    /// bits. Their covariance is `(2/pi) asin(correlation of the innovations)` (arcsine law), theirs with the state
    /// `sqrt(2/pi) P H' D^(-1/2)`.
    ///
    /// # Errors
    /// [`fewbits_filters::Error::SingularInnovation`] if the belief is no covariance.
    pub fn update_parallel(&self, predicted: &Gaussian<D>, bits: &[Sign; M]) -> Result<Gaussian<D>, Error> {
        if M == 0 {
            return Ok(*predicted);
        }
        let (gain, covariance) = self.parallel_gain(predicted)?;
        let signs = SVector::<f64, M>::from_fn(|i, _| bits[i].value());
        Ok(Gaussian::from_trusted_parts(predicted.mean() + gain * signs, covariance))
    }

    fn parallel_gain(&self, predicted: &Gaussian<D>) -> Result<(SMatrix<f64, D, M>, SMatrix<f64, D, D>), Error> {
        let mut crosses = SMatrix::<f64, D, M>::zeros();
        let mut deviations = SVector::<f64, M>::zeros();
        for (i, sensor) in self.sensors.iter().enumerate() {
            let (cross, variance) = innovation(predicted, sensor);
            deviations[i] = variance.sqrt();
            crosses.set_column(i, &(cross * (SQRT_2_OVER_PI / deviations[i])));
        }
        let bits = SMatrix::<f64, M, M>::from_fn(|i, j| {
            if i == j {
                // asin near 1 would turn a rounding error of 1e-16 into 1e-8.
                return 1.0;
            }
            let direction = self.sensors[i].direction();
            let covariance = direction.dot(&(predicted.covariance() * self.sensors[j].direction()));
            FRAC_2_PI * (covariance / (deviations[i] * deviations[j])).clamp(-1.0, 1.0).asin()
        });
        let factor = Cholesky::new(symmetrised(&bits)).ok_or(fewbits_filters::Error::SingularInnovation)?;
        let gain = factor.solve(&crosses.transpose()).transpose();
        Ok((gain, predicted.covariance() - gain * crosses.transpose()))
    }

    /// Steady covariances with the threshold refreshed after every sensor, in the order of the sensors.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub fn sequential_steady_state(&self) -> Result<SteadyState<D>, Error> {
        self.settle(|predicted| {
            Ok(self
                .sensors
                .iter()
                .fold(*predicted, |belief, sensor| sign_update(&belief, sensor, Sign::Above)))
        })
    }

    /// Steady covariances with all thresholds at the prediction.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub fn parallel_steady_state(&self) -> Result<SteadyState<D>, Error> {
        self.settle(|predicted| self.update_parallel(predicted, &[Sign::Above; M]))
    }

    fn settle(&self, slot: impl Fn(&Gaussian<D>) -> Result<Gaussian<D>, Error>) -> Result<SteadyState<D>, Error> {
        let mut filtered = Gaussian::from_trusted_parts(SVector::zeros(), SMatrix::identity());
        for _ in 0..MOST_STEPS {
            let predicted = self.predict(&filtered);
            let next = slot(&predicted)?;
            let change = (next.covariance() - filtered.covariance()).amax();
            let settled = change <= SETTLED * next.covariance().amax();
            // Only covariances matter; the mean is kept from wandering.
            filtered = Gaussian::from_trusted_parts(SVector::zeros(), *next.covariance());
            if settled {
                return Ok(SteadyState {
                    predicted_covariance: *predicted.covariance(),
                    filtered_covariance: *filtered.covariance(),
                });
            }
        }
        Err(Error::NotConverged {
            what: "the covariance recursion",
            iterations: MOST_STEPS,
        })
    }
}

/// Riccati steps after which a recursion is given up.
const MOST_STEPS: usize = 100_000;
/// Relative change at which a covariance has settled.
const SETTLED: f64 = 1e-15;

#[cfg(test)]
mod tests {
    use super::{SignFilter, sign_update, vector_bit_update};
    use crate::{DymboFilter, ScalarPlant, bit_update};
    use fewbits_core::{Gaussian, Sign};
    use fewbits_filters::kalman;
    use fewbits_models::{Ar1, LinearGaussian, LinearSensor, ScalarSensor};
    use nalgebra::{Matrix2, SMatrix, Vector1, Vector2};

    fn belief() -> Gaussian<2> {
        Gaussian::new(Vector2::new(0.3, -1.0), Matrix2::new(2.0, 0.5, 0.5, 1.0)).unwrap()
    }

    #[test]
    fn in_one_dimension_it_is_the_scalar_filter() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.2).unwrap();
        let predicted = Gaussian::scalar(0.7, 1.4).unwrap();
        let scalar = DymboFilter::new(plant).update(&predicted, Sign::Below).0;
        let vector = sign_update(&predicted, plant.sensor(), Sign::Below);
        assert!(
            (scalar.mean() - vector.mean()).amax() < 1e-15
                && (scalar.covariance() - vector.covariance()).amax() < 1e-15
        );
        let general = bit_update(&predicted, 1.2, Sign::Below, 2.0, 0.1).unwrap().0;
        let vector = vector_bit_update(&predicted, plant.sensor(), Sign::Below, 2.0, 0.1)
            .unwrap()
            .0;
        assert!((general.mean() - vector.mean()).amax() < 1e-14);
        assert!((general.covariance() - vector.covariance()).amax() < 1e-14);
    }

    #[test]
    fn a_bit_at_the_prediction_is_a_kalman_step_with_inflated_noise() {
        let sensor = ScalarSensor::scalar(Vector2::new(1.0, -0.5), 0.8).unwrap();
        let seen = (sensor.matrix() * belief().covariance() * sensor.matrix().transpose())[0];
        let noise = std::f64::consts::FRAC_PI_2 * (seen + 0.8) - seen;
        let equivalent = LinearSensor::scalar(sensor.direction(), noise).unwrap();
        let analog = kalman::update(&equivalent, &belief(), &Vector1::zeros()).unwrap().0;
        let bit = sign_update(&belief(), &sensor, Sign::Above);
        assert!((bit.covariance() - analog.covariance()).amax() < 1e-14);
        let threshold = sensor.direction().dot(belief().mean());
        let general = vector_bit_update(&belief(), &sensor, Sign::Above, threshold, 0.0)
            .unwrap()
            .0;
        assert!(
            (bit.mean() - general.mean()).amax() < 1e-14 && (bit.covariance() - general.covariance()).amax() < 1e-14
        );
        // What a sensor cannot see does not move.
        let blind = ScalarSensor::scalar(Vector2::zeros(), 1.0).unwrap();
        assert_eq!(vector_bit_update(&belief(), &blind, Sign::Above, 0.0, 0.0).unwrap().0, belief());
    }

    #[test]
    fn parallel_fusion_of_one_or_no_sensor() {
        let dynamics =
            LinearGaussian::with_covariance(Matrix2::new(0.95, 0.25, -0.1, 0.9), Matrix2::identity() * 0.3).unwrap();
        let sensor = ScalarSensor::scalar(Vector2::new(1.0, 0.5), 1.0).unwrap();
        let filter = SignFilter::new(dynamics, [sensor]);
        let parallel = filter.update_parallel(&belief(), &[Sign::Below]).unwrap();
        let sequential = filter.update(&belief(), 0, Sign::Below);
        assert!((parallel.mean() - sequential.mean()).amax() < 1e-14);
        assert!((parallel.covariance() - sequential.covariance()).amax() < 1e-14);
        let blind = SignFilter::new(dynamics, []);
        assert_eq!(blind.update_parallel(&belief(), &[]).unwrap(), belief());
        let alone = blind.sequential_steady_state().unwrap();
        assert!((alone.filtered_covariance - dynamics.stationary_covariance().unwrap()).amax() < 1e-11);
    }

    #[test]
    fn identical_sensors_in_parallel_are_the_scalar_count() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let filter = SignFilter::new(Ar1::new(0.9, 0.5).unwrap(), [*plant.sensor(); 3]);
        let count = crate::ParallelFilter::new(plant, 3, crate::CountFusion::Linear).unwrap();
        let predicted = Gaussian::scalar(0.0, 1.1).unwrap();
        let both = filter
            .update_parallel(&predicted, &[Sign::Above, Sign::Above, Sign::Below])
            .unwrap();
        let (corrections, variance) = count.table(1.1);
        assert!((both.mean()[0] - corrections[2]).abs() < 1e-13 && (both.covariance()[0] - variance).abs() < 1e-13);
        let stuck = Gaussian::from_trusted_parts(Vector1::zeros(), SMatrix::<f64, 1, 1>::from([[f64::NAN]]));
        assert!(filter.update_parallel(&stuck, &[Sign::Above; 3]).is_err());
    }
}
