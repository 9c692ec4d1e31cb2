//! Vector states: the sign-of-innovations filter.
//!
//! The bit is the sign of `x - h' prediction`; it moves the estimate along `P h`. The update equals a Kalman update with noise variance
//! `(pi/2)(h'Ph + sigma^2) - h'Ph`. The sensors of a slot report one after the other, each against the refreshed prediction, or
//! all at once against the same one.

use super::SteadyState;
use fewbits_core::{Factor, Gaussian, LinearDynamics, Link, Observation, Scheme, Sign};
use fewbits_dymbo::{Error, SignBit, sign_bit};
use fewbits_filters::kalman;
use fewbits_models::ScalarSensor;
use fewbits_numerics::error::ArgumentError;
use fewbits_numerics::linalg::{solve_semidefinite, symmetrised};
use fewbits_numerics::normal::SQRT_2_OVER_PI;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::LN_2;

/// Likelihood and bits of one update.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VectorInfo {
    /// `ln p(observations | past)`, the increment of the log-likelihood of the data. For several bits at once it is the
    /// approximation by assumed-density updates with one bit after the other.
    pub log_likelihood: f64,
    /// Number of bits received in this update.
    pub bits: u32,
}

/// The filter for `M` one-bit sensors of a `D`-dimensional linear system.
///
/// Each update is the assumed-density update with the factor of a [`SignBit`]. With the threshold at the prediction it has the closed
/// form `mean + b c sqrt(2/pi) P h/s`, `P - c^2 (2/pi) P h h' P/s^2` with `s^2 = h'Ph + sigma^2` and, for a link of crossover `e`,
/// `c = 1 - 2 e`.
///
/// ```
/// use fewbits_core::{Gaussian, Observation, Sign};
/// use fewbits_baselines::dymbo::SignFilter;
/// use fewbits_models::{constant_velocity_1d, ScalarSensor};
/// let position = ScalarSensor::scalar([1.0, 0.0].into(), 1.0)?;
/// let filter = SignFilter::new(constant_velocity_1d(1.0, 0.1)?, [position]);
/// let mut belief = Gaussian::new([0.0, 1.0].into(), nalgebra::Matrix2::identity())?;
/// for sample in [1.1, 2.3, 2.9] {
///     belief = filter.predict(&belief);
///     let bit = Sign::of(sample, filter.threshold(&belief, 0)?)?;
///     belief = filter.update(&belief, 0, &Observation::Received(bit))?.0;
/// }
/// assert!((belief.mean()[0] - 3.0).abs() < 1.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SignFilter<F, const D: usize, const M: usize> {
    dynamics: F,
    sensors: [ScalarSensor<D>; M],
    link: Link,
}

impl<F: LinearDynamics<D>, const D: usize, const M: usize> SignFilter<F, D, M> {
    /// The filter for these dynamics and sensors over perfect links; without sensors it only predicts.
    pub fn new(dynamics: F, sensors: [ScalarSensor<D>; M]) -> Self {
        Self {
            dynamics,
            sensors,
            link: Link::PERFECT,
        }
    }

    /// The same filter for other links. All sensors have the same link.
    #[must_use]
    pub fn with_link(self, link: Link) -> Self {
        Self { link, ..self }
    }

    /// The model of the state.
    pub fn dynamics(&self) -> &F {
        &self.dynamics
    }

    /// The sensors, in the order of the observations.
    pub fn sensors(&self) -> &[ScalarSensor<D>; M] {
        &self.sensors
    }

    fn sensor(&self, sensor: usize) -> Result<&ScalarSensor<D>, ArgumentError> {
        let refusal = || ArgumentError::new("sensor", sensor, format!("an index below {M}"));
        self.sensors.get(sensor).ok_or_else(refusal)
    }

    /// The belief one slot later, before any observation.
    #[inline]
    pub fn predict(&self, belief: &Gaussian<D>) -> Gaussian<D> {
        kalman::predict(&self.dynamics, belief)
    }

    /// The threshold to broadcast to a sensor: its predicted measurement under the belief so far.
    ///
    /// # Errors
    /// If `sensor` is not below `M`.
    #[inline]
    pub fn threshold(&self, predicted: &Gaussian<D>, sensor: usize) -> Result<f64, Error> {
        Ok(self.sensor(sensor)?.direction().dot(predicted.mean()))
    }

    /// Corrects a belief with the observation of one sensor. Its threshold was [`SignFilter::threshold`] of the same belief.
    ///
    /// # Errors
    /// If `sensor` is not below `M`; [`Error::Impossible`].
    #[inline]
    pub fn update(
        &self,
        predicted: &Gaussian<D>,
        sensor: usize,
        observation: &Observation<Sign>,
    ) -> Result<(Gaussian<D>, VectorInfo), Error> {
        let &Observation::Received(bit) = observation else {
            self.sensor(sensor)?;
            let log_likelihood = self.link.delivery(observation).ln();
            let info = VectorInfo {
                log_likelihood,
                bits: 0,
            };
            return if log_likelihood.is_finite() {
                Ok((*predicted, info))
            } else {
                Err(Error::Impossible)
            };
        };
        let (sensor, clean) = (self.sensor(sensor)?, 1.0 - 2.0 * self.link.crossover());
        let cross = predicted.covariance() * sensor.direction();
        let variance = sensor.direction().dot(&cross) + sensor.noise_variance();
        let step = cross * (clean * SQRT_2_OVER_PI / variance.sqrt());
        let mean = predicted.mean() + step * bit.value();
        // With the threshold at the prediction both bits have probability 1/2, for any crossover.
        let info = VectorInfo {
            log_likelihood: -LN_2 + self.link.of_received()?.ln(),
            bits: 1,
        };
        let covariance = predicted.covariance() - step * step.transpose();
        let posterior = Gaussian::from_symmetric_parts(mean, covariance);
        if !posterior.is_finite() {
            let what = "the posterior (from the belief or the sensor)";
            return Err(Error::NotANumber { what });
        }
        Ok((posterior, info))
    }

    /// Corrects a belief with the observations of all sensors, whose thresholds were those of this belief. The update is the best linear
    /// function of the bits. The covariance of two bits is `(2/pi) asin(correlation of the innovations)` (arcsine law). Their covariance
    /// with the state is `sqrt(2/pi) P H' D^(-1/2)`, `D` the innovation variances. Crossovers shrink both.
    ///
    /// # Errors
    /// If the belief's covariance is not positive semidefinite; [`Error::Impossible`]; [`Error::NotANumber`].
    pub fn update_parallel(
        &self,
        predicted: &Gaussian<D>,
        observations: &[Observation<Sign>; M],
    ) -> Result<(Gaussian<D>, VectorInfo), Error> {
        let (crosses, mut spread) = self.innovations(predicted);
        let (gain, covariance) = self.parallel_gain(predicted, &crosses, &spread, observations)?;
        let signs = SVector::<f64, M>::from_fn(|i, _| observations[i].received().map_or(0.0, |bit| bit.value()));
        let mut info = VectorInfo {
            log_likelihood: 0.0,
            bits: observations.iter().filter(|o| o.received().is_some()).count() as u32,
        };
        // Likelihood: assumed-density updates with one bit after the other, on the noise-free measurements instead of the state.
        // A bit leaves at least a third of a variance, so no difference cancels.
        let mut mean = SVector::<f64, M>::zeros();
        for (i, (sensor, observation)) in self.sensors.iter().zip(observations).enumerate() {
            let seen = (spread[(i, i)] - sensor.noise_variance()).max(0.0);
            let prior = Gaussian::from_trusted_parts([mean[i]].into(), [[seen]].into());
            let factor = SignBit::new(sensor.noise_variance())?.factor(&0.0, observation, &self.link)?;
            let tilted = factor.tilted(&prior)?;
            if seen > 0.0 {
                let gain = spread.column(i) / seen;
                mean += gain * (tilted.mean[0] - mean[i]);
                spread -= gain * gain.transpose() * (seen - tilted.covariance[0]);
            }
            info.log_likelihood += tilted.log_evidence;
        }
        let posterior = Gaussian::from_trusted_parts(predicted.mean() + gain * signs, covariance);
        if !(posterior.is_finite() && info.log_likelihood.is_finite()) {
            let what = "the posterior (from the belief or the sensors)";
            return Err(Error::unlikely_or_no_number(info.log_likelihood, what));
        }
        Ok((posterior, info))
    }

    /// Covariance of each innovation with the state, and the covariance matrix of the innovations.
    fn innovations(&self, predicted: &Gaussian<D>) -> ([SVector<f64, D>; M], SMatrix<f64, M, M>) {
        let crosses = self.sensors.map(|sensor| predicted.covariance() * sensor.direction());
        let spread = SMatrix::from_fn(|i, j| {
            let noise = if i == j { self.sensors[i].noise_variance() } else { 0.0 };
            self.sensors[i].direction().dot(&crosses[j]) + noise
        });
        (crosses, spread)
    }

    /// Gain and posterior covariance. Sensors that were not received have gain zero.
    fn parallel_gain(
        &self,
        predicted: &Gaussian<D>,
        crosses: &[SVector<f64, D>; M],
        spread: &SMatrix<f64, M, M>,
        observations: &[Observation<Sign>; M],
    ) -> Result<(SMatrix<f64, D, M>, SMatrix<f64, D, D>), Error> {
        if M == 0 {
            return Ok((SMatrix::zeros(), *predicted.covariance()));
        }
        let information = sign_bit::information(&self.link);
        let received = |i: usize| observations[i].received().is_some();
        let deviations = spread.diagonal().map(f64::sqrt);
        // A crossover `e` multiplies the mean of a bit by `1 - 2 e`: once in its covariance with the state, twice in that of two bits.
        let with_state = SMatrix::<f64, D, M>::from_fn(|d, i| {
            if received(i) {
                crosses[i][d] * (information.sqrt() / deviations[i])
            } else {
                0.0
            }
        });
        // The diagonal is set to 1 directly: near 1, asin would turn a rounding error of 1e-16 into 1e-8.
        let mut bits = SMatrix::<f64, M, M>::identity();
        for (i, j) in (0..M).flat_map(|i| (0..i).map(move |j| (i, j))) {
            if received(i) && received(j) {
                let correlation = spread[(i, j)] / (deviations[i] * deviations[j]);
                bits[(i, j)] = information * correlation.clamp(-1.0, 1.0).asin();
                bits[(j, i)] = bits[(i, j)];
            }
        }
        // Sensors whose noise is negligible beside the prediction's variance send equal bits: the covariance of the bits is singular.
        let gain = solve_semidefinite(&bits, &with_state.transpose())?.transpose();
        let covariance = predicted.covariance() - gain * with_state.transpose();
        if covariance.iter().any(|v| !v.is_finite()) {
            let what = "the covariance of the bits (from the belief or the sensors)";
            return Err(Error::NotANumber { what });
        }
        Ok((gain, covariance))
    }

    /// Steady covariances with the threshold refreshed after every sensor, in the order of the sensors, when every bit arrives.
    ///
    /// # Errors
    /// [`Error::NotConverged`] if the recursion does not converge.
    pub fn sequential_steady_state(&self) -> Result<SteadyState<D>, Error> {
        let bit = Observation::Received(Sign::Above);
        self.settle(|predicted| {
            let slot = (0..M).try_fold(*predicted, |belief, i| Ok::<_, Error>(self.update(&belief, i, &bit)?.0))?;
            Ok(*slot.covariance())
        })
    }

    /// Steady covariances with all thresholds at the prediction, when every bit arrives.
    ///
    /// # Errors
    /// [`Error::NotConverged`] if the recursion does not converge.
    pub fn parallel_steady_state(&self) -> Result<SteadyState<D>, Error> {
        let bits = [Observation::Received(Sign::Above); M];
        self.settle(|predicted| {
            let (crosses, spread) = self.innovations(predicted);
            Ok(self.parallel_gain(predicted, &crosses, &spread, &bits)?.1)
        })
    }

    fn settle(
        &self,
        slot: impl Fn(&Gaussian<D>) -> Result<SMatrix<f64, D, D>, Error>,
    ) -> Result<SteadyState<D>, Error> {
        // Only covariances matter: they depend on neither the bits nor the mean.
        let mut filtered = SMatrix::<f64, D, D>::identity();
        for _ in 0..MAX_STEPS {
            let predicted = self.predict(&Gaussian::from_trusted_parts(SVector::zeros(), filtered));
            let next = slot(&predicted)?;
            let settled = (next - filtered).amax() <= SETTLED * next.amax();
            filtered = next;
            if settled {
                return Ok(SteadyState {
                    predicted_covariance: *predicted.covariance(),
                    filtered_covariance: symmetrised(&filtered),
                });
            }
        }
        Err(Error::NotConverged {
            what: "the covariance recursion",
            steps: MAX_STEPS,
            unit: "iterations",
        })
    }
}

/// Limit on the steps of the covariance recursion.
const MAX_STEPS: usize = 100_000;
/// Relative change of the covariance below which the recursion has converged.
const SETTLED: f64 = 1e-15;

#[cfg(test)]
mod tests;
