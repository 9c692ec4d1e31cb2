//! Lower bounds on the mean squared error from quantized sensors.
//!
//! | bound | holds for | function |
//! |---|---|---|
//! | remote distortion-rate (2.15) | any code of one noisy source, any block length | [`remote_distortion_rate`] |
//! | quadratic Gaussian CEO | any codes at separate sensors with independent noise | [`ceo`] |
//! | unquantised samples | any quantizers | [`unquantised`] |

mod ceo;
mod unquantised;

pub use ceo::{CeoBound, ceo};
pub use unquantised::unquantised;

use crate::error::{Error, refuse};
use crate::observation_model::{Noise, Prior};

/// `D(R) = s_x^2 - s_x^4 / (s_x^2 + s^2) (1 - 2^{-2R})` (2.15): the least squared error in `X` from `R` bits about the samples of sensors
/// that are encoded together. Their noises combine to `1 / s^2 = 1' Sigma^-1 1`.
///
/// # Errors
/// If the prior is not Gaussian, or `bits` is negative or not finite.
pub fn remote_distortion_rate(prior: &Prior, noise: &Noise, bits: f64) -> Result<f64, Error> {
    let prior = prior_variance(prior)?;
    let bits = fewbits_numerics::error::non_negative("bits", bits)?;
    // The error from the noise alone plus the remaining part, which loses no digits.
    let left = 1.0 / (1.0 / prior + noise.precision_of_mean());
    Ok(left + (prior - left) * (-2.0 * bits).exp2())
}

/// Variance of a Gaussian prior.
fn prior_variance(prior: &Prior) -> Result<f64, Error> {
    if !prior.is_normal() {
        return refuse("prior", "another prior", "a Gaussian prior");
    }
    Ok(fewbits_numerics::error::positive("prior variance", prior.deviation() * prior.deviation())?)
}

/// Variance of each sensor's noise; an error if the noise is correlated.
fn independent_variances(noise: &Noise) -> Result<Vec<f64>, Error> {
    if !noise.is_independent() {
        return refuse("noise", "correlated noise", "independent noise");
    }
    (0..noise.sensors())
        .map(|n| Ok(fewbits_numerics::error::positive("noise variance", noise.deviation(n).powi(2))?))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn unit() -> Prior {
        Prior::normal(0.0, 1.0).unwrap()
    }

    pub(super) fn noise_of(variances: &[f64]) -> Noise {
        let deviations: Vec<f64> = variances.iter().map(|v| v.sqrt()).collect();
        Noise::independent_with_deviations(&deviations).unwrap()
    }

    #[test]
    fn a_remote_source_in_almost_no_noise_keeps_its_digits() {
        for (noise, bits, exact) in [
            (1e-12_f64, 30.0, 1e-12 + 2f64.powi(-60)),
            (1e-17, 30.0, 1e-17 + 2f64.powi(-60)),
            (1e-17, 0.0, 1.0),
        ] {
            let found = remote_distortion_rate(&unit(), &noise_of(&[noise]), bits).unwrap();
            assert!((found / exact - 1.0).abs() < 1e-11, "{noise} {bits}: {found}");
        }
    }

    #[test]
    fn samples_encoded_together_are_one_of_less_noise() {
        let together = remote_distortion_rate(&unit(), &noise_of(&[1.0, 0.5]), 2.0).unwrap();
        let one = remote_distortion_rate(&unit(), &noise_of(&[1.0 / 3.0]), 2.0).unwrap();
        assert!((together - one).abs() < 1e-15);
    }

    #[test]
    fn bad_rates_are_refused() {
        assert!(remote_distortion_rate(&unit(), &noise_of(&[1.0]), -1.0).is_err());
        assert!(remote_distortion_rate(&Prior::binary(1.0, 0.5).unwrap(), &noise_of(&[1.0]), 1.0).is_err());
        // The mean of two samples has noise of variance (1 + .5) / 2.
        let correlated = Noise::equicorrelated_with_deviations(&[1.0; 2], 0.5).unwrap();
        let found = remote_distortion_rate(&unit(), &correlated, 1.0).unwrap();
        assert!((found - remote_distortion_rate(&unit(), &noise_of(&[0.75]), 1.0).unwrap()).abs() < 1e-15);
    }
}
