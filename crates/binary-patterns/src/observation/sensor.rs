//! A sensor with a one-bit quantizer, as a scheme.

use crate::{BinaryQuantizer, Error};
use fewbits_core::{Noise, Quantized};
use fewbits_numerics::error::positive;

/// A sensor that measures `Y = X + N(0, noise_deviation^2)` and reports the bit of its quantizer.
#[derive(Debug, Clone, PartialEq)]
pub struct PatternSensor {
    quantizer: BinaryQuantizer,
    noise_deviation: f64,
}

impl PatternSensor {
    /// A sensor with the given quantizer and standard deviation (not variance) of its noise.
    ///
    /// # Errors
    /// If `noise_deviation` is not positive and finite.
    pub fn with_deviation(quantizer: BinaryQuantizer, noise_deviation: f64) -> Result<Self, Error> {
        let noise_deviation = positive("noise_deviation", noise_deviation)?;
        Ok(Self {
            quantizer,
            noise_deviation,
        })
    }

    /// The sensor's quantizer.
    pub fn quantizer(&self) -> &BinaryQuantizer {
        &self.quantizer
    }

    /// Standard deviation of the measurement noise.
    pub fn noise_deviation(&self) -> f64 {
        self.noise_deviation
    }

    /// `[ln P(0|x), ln P(1|x)]`.
    #[doc(hidden)]
    pub fn log_probabilities(&self, x: f64) -> [f64; 2] {
        self.quantizer.log_probabilities(x, self.noise_deviation)
    }
}

/// The report is the bit of the cell that contains the measurement.
impl Quantized for PatternSensor {
    type Feedback = ();
    type Report = bool;

    fn format_of_feedback(&self) {}

    fn format_of_report(&self) {}

    fn measurement_noise(&self) -> Noise {
        (self.noise_deviation * self.noise_deviation).into()
    }

    fn report_of(&self, measurement: f64, (): &()) -> Result<bool, fewbits_core::Error> {
        Ok(self.quantizer.encode(measurement)?)
    }

    fn edges(&self, (): &()) -> Result<Vec<f64>, fewbits_core::Error> {
        Ok(self.quantizer.breakpoints().to_vec())
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        (0..=self.quantizer.breakpoints().len() as u64).map(|cell| cell % 2)
    }

    fn word_of(&self, bit: &bool) -> Result<u64, fewbits_core::Error> {
        Ok(u64::from(*bit))
    }

    fn word_bits(&self) -> u32 {
        1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::{factor, message, scheme};
    use fewbits_core::nalgebra::SVector;
    use fewbits_core::{Gaussian, Link, Message, Observation, Scheme};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_bit_takes_one_bit() {
        for bit in [false, true] {
            assert_eq!(message::round_trip(&bit, &()).unwrap(), 1);
            assert!(message::decoding_is_total::<bool>(&bit.to_bits(&()).unwrap(), &()));
        }
    }

    #[test]
    fn a_bit_of_a_pattern_is_a_lawful_factor() {
        for scale in [1e-4, 1.0, 1e4] {
            let quantizer = BinaryQuantizer::new([-0.5, 0.4, 1.1].map(|b| scale * b).to_vec()).unwrap();
            let sensor = PatternSensor::with_deviation(quantizer, 0.3 * scale).unwrap();
            let points = [-1e9, -3.0, -0.4, 0.0, 0.7, 30.0].map(|m| SVector::from([scale * m]));
            let prior = Gaussian::scalar(0.2 * scale, scale * scale).unwrap();
            scheme::deterministic(&sensor, &(), &[1, 2].map(rand_pcg::Pcg64Mcg::seed_from_u64), &points).unwrap();
            for link in [Link::PERFECT, Link::new(0.3, 0.1).unwrap().with_erasure(0.2).unwrap()] {
                let bits = [false, true];
                scheme::total_probability(&sensor, &(), &link, bits, &points).unwrap();
                let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
                let noise = |rng: &mut rand_pcg::Pcg64Mcg| {
                    SVector::from([0.3 * scale * rng.sample::<f64, _>(rand_distr::StandardNormal)])
                };
                let m = SVector::from([0.25 * scale]);
                scheme::frequencies(&sensor, &(), &link, &mut rng, 20_000, &m, noise, bits).unwrap();
                for bit in bits {
                    let received = sensor.factor(&(), &Observation::Received(bit), &link).unwrap();
                    factor::is_a_number(&received, &points).unwrap();
                    factor::sweep_is_scalar(&received, &points).unwrap();
                    factor::tilted_is_quadrature(&received, &prior, 12.0 * scale, 20_001, 1e-9).unwrap();
                    use fewbits_core::Factor;
                    if link == Link::PERFECT {
                        let log = sensor.log_probabilities(0.4 * scale)[usize::from(bit)];
                        assert!((received.log_likelihood(&SVector::from([0.4 * scale])) - log).abs() < 1e-12);
                    }
                }
            }
            assert!(sensor.quantizer().encode(f64::NAN).is_err());
        }
    }
}
