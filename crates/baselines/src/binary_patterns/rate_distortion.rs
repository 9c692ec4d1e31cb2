//! Remote rate-distortion bounds (appendix B.1): the source is observed in noise, and a limited number of bits describes the observation.
//! [`centralised_bound`](super::centralised_bound) is tighter.

use super::ConditionalMean;
use fewbits_binary_patterns::engine::Kind;
use fewbits_binary_patterns::{Error, Source};
use fewbits_numerics::error::{at_least_one, non_negative, positive};
use std::f64::consts::{E, PI};

/// Shannon's lower bound on the distortion at rate `R`: `D1 + Q1 2^(-2R)` (appendix B.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RemoteDistortion {
    /// `D1 = E Var[X|Y]`.
    pub estimation_error: f64,
    /// `Q1 = 2^(2h) / (2 pi e)`, entropy power of `E[X|Y]`, with `h` its differential entropy in bits.
    pub entropy_power: f64,
}

impl RemoteDistortion {
    /// The bound at `rate` bits per source sample, in squared units of the source.
    ///
    /// # Errors
    /// If the rate is negative or not finite.
    pub fn at(&self, rate: f64) -> Result<f64, Error> {
        let rate = non_negative("rate", rate)?;
        Ok(self.estimation_error + self.entropy_power * (-2.0 * rate).exp2())
    }
}

/// The remote rate-distortion bound for one measurement with noise `noise_deviation`.
///
/// The distortion is exactly the sum of `E Var[X|Y]` and the distortion of describing `E[X|Y]`: the cross term is
/// zero by orthogonality, for every quantizer (erratum `binary-9`). The entropy is computed without inverse function:
/// `h(E[X|Y]) = h(Y) + E log2 f'(Y)` with `f'(y) = Var[X|y]/s^2`. For a Gaussian source this is equation 5.12,
/// `D(R) = sx^2 - sx^4/(sx^2 + s^2) (1 - 2^(-2R))`.
///
/// # Errors
/// If `noise_deviation` is not positive and finite.
pub fn remote_distortion(source: &Source, noise_deviation: f64) -> Result<RemoteDistortion, Error> {
    let measurement = ConditionalMean::with_deviation(*source, noise_deviation)?;
    if let Kind::Gaussian { deviation } = source.kind() {
        let gain = deviation * deviation / (deviation * deviation + noise_deviation * noise_deviation);
        return Ok(RemoteDistortion {
            estimation_error: gain * noise_deviation * noise_deviation,
            entropy_power: gain * deviation * deviation,
        });
    }
    let reach = measurement.measurement_reach();
    let log2_variance_scale = 2.0 * noise_deviation.log2();
    let entropy = measurement.integrate(-reach, reach, |y, _, variance| {
        variance.log2() - log2_variance_scale - measurement.measurement_density(y).log2()
    });
    Ok(RemoteDistortion {
        estimation_error: measurement.estimation_error(),
        entropy_power: (2.0 * entropy).exp2() / (2.0 * PI * E),
    })
}

/// The bound for `sensors` measurements of equal noise and one bit each: noise `s^2/N` and rate `N`.
///
/// The thesis uses `s^2` with `N` bits (erratum `binary-6`). Schemes with several sensors have smaller errors: three sign bits of a
/// Gaussian source at -5 dB have 0.0649 where it gives 0.0764 as bound; the value here is 0.0521.
///
/// # Errors
/// If `noise_deviation` is not positive and finite or there is no sensor.
pub fn network_rate_distortion(source: &Source, noise_deviation: f64, sensors: usize) -> Result<f64, Error> {
    let sensors = at_least_one("sensors", sensors)? as f64;
    remote_distortion(source, positive("noise_deviation", noise_deviation)? / sensors.sqrt())?.at(sensors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_rates_are_refused() {
        let bound = remote_distortion(&Source::uniform(1.0).unwrap(), 0.3).unwrap();
        assert!(bound.at(-1.0).is_err());
        assert!(bound.at(f64::NAN).is_err());
        assert!(network_rate_distortion(&Source::uniform(1.0).unwrap(), 0.3, 0).is_err());
        assert!(remote_distortion(&Source::uniform(1.0).unwrap(), 0.0).is_err());
    }
}
