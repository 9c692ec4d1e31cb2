//! Sensors that send every measurement.

use fewbits_cfwmd::censored::Censored;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_core::{Error, Link, MeasurementNoise, Memoryless, NumberFormat, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, positive, within};
use nalgebra::{Matrix1, Vector1};

/// Every measurement, rounded to the format: what all other schemes save on. Without feedback; a value wants a checksum, so no bit
/// may arrive inverted.
#[derive(Debug, Clone, PartialEq)]
pub struct SendAll {
    noise_variance: f64,
    format: NumberFormat,
    always: CensoringRule<1>,
}

impl SendAll {
    /// Measurements with noise of the given variance in the given format.
    ///
    /// # Errors
    /// If the variance is not a positive number.
    pub fn new(noise_variance: f64, format: NumberFormat) -> Result<Self, ArgumentError> {
        positive("noise_variance", noise_variance)?;
        let always = CensoringRule::scalar(1.0, 0.0)
            .map_err(|error| ArgumentError::new("noise_variance", noise_variance, error.to_string()))?;
        Ok(Self {
            noise_variance,
            format,
            always,
        })
    }
}

impl MeasurementNoise<1> for SendAll {
    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.noise_variance)
    }
}

impl Memoryless<1> for SendAll {
    type Feedback = ();
    type Report = f64;
    type Factor = Censored<1>;

    fn feedback_format(&self) {}

    fn report_format(&self) -> NumberFormat {
        self.format
    }

    fn report_of(&self, measurement: &Vector1<f64>, (): &()) -> Result<Option<f64>, Error> {
        Ok(Some(self.format.rounded(measurement[0])?))
    }

    fn meaning_of(&self, (): &(), observation: &Observation<f64>, link: &Link) -> Result<Censored<1>, Error> {
        within("crossover", link.crossover(), 0.0, 0.0)?;
        Ok(match (observation, &self.format) {
            (Observation::Received(value), NumberFormat::Fixed(levels)) => {
                Censored::level(*value, levels, &self.always, *value, self.noise_variance, link.of_received()?)?
            }
            (Observation::Received(value), _) => {
                all_finite("report", &[*value])?;
                Censored::value(&Vector1::new(*value), &[[self.noise_variance]].into(), link.of_received()?)?
            }
            (missing, _) => Censored::constant(link.delivery(missing))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws;
    use fewbits_core::{Factor, Gaussian, Scheme};

    #[test]
    fn all_levels_are_a_distribution_and_a_value_is_the_kalman_update() {
        let format = NumberFormat::fixed(-2.0, 2.0, 3).unwrap();
        let scheme = SendAll::new(0.5, format).unwrap();
        let levels = (0..8).map(|i| format.rounded(-2.0 + 4.0 * f64::from(i) / 7.0).unwrap());
        let points = [-9.0, -0.3, 0.0, 1.1].map(Vector1::new);
        let link = Link::lossy(0.2).unwrap().with_erasure(0.1).unwrap();
        laws::scheme::total_probability(&scheme, &(), &link, levels, &points).unwrap();
        let plain = SendAll::new(0.5, NumberFormat::Double).unwrap();
        let factor = plain.factor(&(), &Observation::Received(1.0), &link).unwrap();
        let posterior = factor.tilted(&Gaussian::scalar(0.0, 0.5).unwrap()).unwrap();
        assert!((posterior.mean[0] - 0.5).abs() < 1e-14 && (posterior.covariance[0] - 0.25).abs() < 1e-14);
        assert!(SendAll::new(0.0, NumberFormat::Double).is_err());
        assert!(
            plain
                .factor(&(), &Observation::Lost, &Link::flipping(0.1).unwrap())
                .is_err()
        );
    }
}
