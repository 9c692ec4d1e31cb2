//! The scalar linear model: an autoregressive state and noisy samples of it.

use crate::Error;
use fewbits_core::Gaussian;
use fewbits_filters::{ScalarSteadyState, scalar_steady_state};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_numerics::error::{ArgumentError, non_negative, positive};
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

/// A first-order autoregression `theta(n) = a theta(n-1) + u(n)` sensed as `x(n) = theta(n) + w(n)`.
///
/// With measurement standard deviation `sigma`, all variances are `sigma^2` times those for unit noise at the same coefficient and ratio
/// `gamma = sigma_u^2 / sigma^2`.
///
/// Deserialization calls [`ScalarPlant::new`], so it refuses an unstable plant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers", into = "Numbers")]
pub struct ScalarPlant {
    dynamics: Ar1,
    sensor: LinearSensor<1, 1>,
}

/// The stored form of [`ScalarPlant`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    coefficient: f64,
    process_variance: f64,
    measurement_variance: f64,
}

impl From<ScalarPlant> for Numbers {
    fn from(plant: ScalarPlant) -> Self {
        Self {
            coefficient: plant.coefficient(),
            process_variance: plant.process_variance(),
            measurement_variance: plant.measurement_variance(),
        }
    }
}

impl TryFrom<Numbers> for ScalarPlant {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        ScalarPlant::new(parts.coefficient, parts.process_variance, parts.measurement_variance)
    }
}

impl ScalarPlant {
    /// The plant with coefficient `a` in `[-1, 1]`, process variance `sigma_u^2 >= 0` and measurement variance
    /// `sigma^2 > 0`.
    ///
    /// # Errors
    /// If `|a| > 1` or anything else is out of range.
    pub fn new(coefficient: f64, process_variance: f64, measurement_variance: f64) -> Result<Self, Error> {
        non_negative("process_variance", process_variance)?;
        Self::of(Ar1::new(coefficient, process_variance)?, measurement_variance)
    }

    /// As [`new`](Self::new) for any finite coefficient. With `|a| > 1` one bit per sample cannot keep the error bounded for certain.
    ///
    /// # Errors
    /// [`Error::Argument`] if an argument is not finite or a variance is out of range.
    pub fn new_unstable(coefficient: f64, process_variance: f64, measurement_variance: f64) -> Result<Self, Error> {
        non_negative("process_variance", process_variance)?;
        Self::of(Ar1::new_unstable(coefficient, process_variance)?, measurement_variance)
    }

    /// Refuses a plant that corrections of bounded size cannot hold.
    ///
    /// # Errors
    /// If `|a| > 1`: an error beyond `gain / (|a| - 1)` then grows for ever, although the computed variance stays finite.
    pub(crate) fn refuse_unstable(&self) -> Result<(), Error> {
        Ar1::new(self.coefficient(), self.process_variance()).map(drop)
    }

    fn of(dynamics: Ar1, measurement_variance: f64) -> Result<Self, Error> {
        Ok(Self {
            dynamics,
            sensor: LinearSensor::direct(positive("measurement_variance", measurement_variance)?)?,
        })
    }

    /// The model of the state: an AR(1) process.
    pub fn dynamics(&self) -> &Ar1 {
        &self.dynamics
    }

    /// The model of the sample: the state plus noise.
    pub fn sensor(&self) -> &LinearSensor<1, 1> {
        &self.sensor
    }

    /// Coefficient `a`.
    #[inline]
    pub fn coefficient(&self) -> f64 {
        self.dynamics.coefficient()
    }

    /// Process variance `sigma_u^2`.
    #[inline]
    pub fn process_variance(&self) -> f64 {
        self.dynamics.noise_variance()
    }

    /// Measurement variance `sigma^2`.
    #[inline]
    pub fn measurement_variance(&self) -> f64 {
        self.sensor.noise_variance()
    }

    /// The belief one step later: mean `a m`, variance `a^2 M + sigma_u^2`.
    #[inline]
    pub fn predict(&self, belief: &Gaussian<1>) -> Gaussian<1> {
        scalar(self.coefficient() * belief.mean()[0], self.dynamics.predict_variance(belief.covariance()[0]))
    }

    /// The steady predicted and filtered variances if each message brings the fraction `information` of a full measurement's information.
    ///
    /// # Errors
    /// If `information` is outside `[0, 1]`, or there is no finite steady state.
    pub fn steady_state(&self, information: f64) -> Result<ScalarSteadyState, Error> {
        scalar_steady_state(self.coefficient(), self.process_variance(), self.measurement_variance(), information)
    }

    /// Steady filtered variance of the sign-bit filter divided by that of the Kalman filter. It is at least 1 and increases with `|a|` and
    /// with `gamma`.
    ///
    /// The paper prints the inverse (erratum `dymbo-3`). It also states that the ratio is below 2 for every `gamma < 1`; that holds for
    /// `|a| <= 0.979` (`dymbo-4`).
    ///
    /// # Errors
    /// If the process noise is zero: both variances then vanish, or neither reaches a steady state.
    pub fn loss(&self) -> Result<f64, Error> {
        let dymbo = self.steady_state(FRAC_2_PI)?.filtered_variance;
        let kalman = self.steady_state(1.0)?.filtered_variance;
        if kalman > 0.0 {
            Ok(dymbo / kalman)
        } else {
            Err(ArgumentError::new("process_variance", self.process_variance(), "a variance above 0").into())
        }
    }
}

/// Variance after a message with the fraction `c = information` of a full measurement's information:
/// `P - c P^2/(P + sigma^2)`, evaluated in a form without cancellation.
#[inline]
pub fn filtered_variance(predicted_variance: f64, noise_variance: f64, information: f64) -> f64 {
    let (p, r) = (predicted_variance, noise_variance);
    p * (r + (1.0 - information) * p) / (p + r)
}

/// `P/sqrt(P + sigma^2)`: the correction of the estimate per unit of the normalised innovation.
#[inline]
pub fn innovation_gain(predicted_variance: f64, noise_variance: f64) -> f64 {
    predicted_variance / (predicted_variance + noise_variance).sqrt()
}

/// A scalar belief without checks: the caller guarantees a finite mean and a valid variance.
#[inline]
pub(crate) fn scalar(mean: f64, variance: f64) -> Gaussian<1> {
    Gaussian::from_trusted_parts([mean].into(), SMatrix::from([[variance]]))
}

#[cfg(test)]
mod tests {
    use super::ScalarPlant;
    use crate::Error;

    #[test]
    fn refuses_plants_it_cannot_hold() {
        let unstable = ScalarPlant::new(1.2, 0.5, 1.0);
        assert!(matches!(&unstable, Err(Error::Argument(e)) if e.name == "coefficient"));
        assert!(unstable.unwrap_err().to_string().contains("1.2"));
        assert!(ScalarPlant::new_unstable(-1.2, 0.5, 1.0).is_ok());
        for bad in [
            (f64::NAN, 1.0, 1.0),
            (0.9, -0.1, 1.0),
            (0.9, 0.1, 0.0),
            (0.9, f64::INFINITY, 1.0),
            (0.9, 0.1, f64::NAN),
        ] {
            assert!(matches!(ScalarPlant::new(bad.0, bad.1, bad.2), Err(Error::Argument(_))), "{bad:?}");
        }
        let plant = ScalarPlant::new(-0.7, 0.5, 2.0).unwrap();
        let json = serde_json::to_string(&plant).unwrap();
        assert_eq!(serde_json::from_str::<ScalarPlant>(&json).unwrap(), plant);
        assert!(serde_json::from_str::<ScalarPlant>(&json.replace("-0.7", "-1.7")).is_err());
    }
}
