//! One bit per sample: is the sample at or above the broadcast threshold?

use crate::{Error, ScalarPlant};
use fewbits_core::factor::{Constant, Levels, Scalar};
use fewbits_core::rand::Rng;
use fewbits_core::{Deterministic, Link, MeasurementNoise, NumberFormat, Observation, Scheme, Sign};
use fewbits_numerics::error::{ArgumentError, finite, positive};
use nalgebra::{Matrix1, Vector1};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

/// A sensor that reports whether its sample is at or above the broadcast threshold.
///
/// Any threshold is allowed. The Dymbo filter broadcasts the prediction `a theta_hat(n-1)` of the present state, the best threshold for
/// a single step. Equation (14) of the paper prints `theta_hat(n-1)` (erratum `dymbo-1`).
///
/// ```
/// use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme, Sign};
/// use fewbits_dymbo::SignBit;
/// let scheme = SignBit::new(1.0)?;
/// let bit = Sign::of(0.7, 0.0)?;                       // at the sensor: one bit
/// let factor = scheme.factor(&0.0, &Observation::Received(bit), &Link::PERFECT)?;
/// let posterior = factor.tilted(&Gaussian::scalar(0.0, 1.0)?)?;
/// assert!((posterior.mean[0] - std::f64::consts::PI.sqrt().recip()).abs() < 1e-14);
/// # Ok::<(), fewbits_dymbo::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct SignBit {
    noise_variance: f64,
}

/// The stored form of [`SignBit`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    noise_variance: f64,
}

impl TryFrom<Numbers> for SignBit {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        SignBit::new(parts.noise_variance)
    }
}

impl SignBit {
    /// A sensor with measurement variance `sigma^2 > 0`.
    ///
    /// # Errors
    /// If the variance is not positive.
    pub fn new(noise_variance: f64) -> Result<Self, Error> {
        Ok(Self {
            noise_variance: positive("noise_variance", noise_variance)?,
        })
    }

    /// The scheme with the measurement variance of `plant`.
    pub(crate) fn of(plant: &ScalarPlant) -> Self {
        Self {
            noise_variance: plant.measurement_variance(),
        }
    }
}

impl MeasurementNoise<1> for SignBit {
    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.noise_variance)
    }
}

impl Deterministic<1> for SignBit {}

impl Scheme<1> for SignBit {
    type State = ();
    type Feedback = f64;
    type Report = Sign;
    type Factor = Scalar;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) {}

    #[inline]
    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &Vector1<f64>,
        threshold: &f64,
    ) -> Result<Option<Sign>, Error> {
        let reached = fewbits_node::sign_bit(measurement[0], *threshold).map_err(ArgumentError::from)?;
        Ok(Some(if reached { Sign::Above } else { Sign::Below }))
    }

    #[inline]
    fn factor(&self, threshold: &f64, observation: &Observation<Sign>, link: &Link) -> Result<Scalar, Error> {
        finite("threshold", *threshold)?;
        match observation {
            Observation::Received(bit) => {
                link.of_received()?;
                Ok(Levels::sign(*bit, *threshold, self.noise_variance, link)?.into())
            }
            missing => Ok(Constant::of_delivery(missing, link).into()),
        }
    }
}

/// Information of a bit with the threshold at the prediction, divided by a full measurement's, if the bit arrives:
/// `(2/pi)(1 - 2 eps)^2` with the link's crossover `eps`.
pub fn information(link: &Link) -> f64 {
    let clean = 1.0 - 2.0 * link.crossover();
    FRAC_2_PI * clean * clean
}

#[cfg(test)]
mod tests {
    use super::SignBit;
    use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme, Sign};

    #[test]
    fn far_thresholds_keep_their_digits() {
        // lambda (lambda + zeta) exceeds 1 here if formed naively.
        let threshold = 1e5 * 2.0_f64.sqrt();
        let factor = SignBit::new(1.0)
            .unwrap()
            .factor(&threshold, &Observation::Received(Sign::Above), &Link::PERFECT)
            .unwrap();
        let variance = factor.tilted(&Gaussian::scalar(0.0, 1.0).unwrap()).unwrap().covariance[0];
        assert!((0.5..0.5 + 1e-9).contains(&variance));
    }

    #[test]
    fn refuses_what_is_no_number() {
        assert!(SignBit::new(0.0).is_err());
        assert_eq!(SignBit::new(1.7).unwrap().noise_variance, 1.7);
        let scheme = SignBit::new(1.0).unwrap();
        for observation in [
            Observation::Received(Sign::Above),
            Observation::Nothing,
            Observation::Lost,
        ] {
            assert!(scheme.factor(&f64::NAN, &observation, &Link::PERFECT).is_err());
        }
        assert!(serde_json::from_str::<SignBit>(r#"{"noise_variance":-1.0}"#).is_err());
    }
}
