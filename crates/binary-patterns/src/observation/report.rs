//! The report: one bit on the wire, and what it says of the noise-free measurement.

use crate::Error;
use crate::PatternSensor;
use crate::patterns::quantizer::BinaryQuantizer;
use fewbits_core::bits::{BitReader, BitWriter, CodecError};
use fewbits_core::factor::{Constant, Scalar};
use fewbits_core::nalgebra::SVector;
use fewbits_core::rand::Rng;
use fewbits_core::{Deterministic, Link, Message, Observation, Scheme};
use fewbits_quantizers::Quantizer;
use serde::{Deserialize, Serialize};

/// What a one-bit sensor reports: the bit of the cell that holds its measurement. One bit on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Bit(pub bool);

impl Message for Bit {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(self.0), 1)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        reader.read_bit().map(Self)
    }
}

impl BinaryQuantizer {
    /// The report of a measurement.
    ///
    /// # Errors
    /// If the measurement is NaN.
    pub fn report(&self, measurement: f64) -> Result<Bit, Error> {
        self.encode(measurement).map(Bit)
    }
}

/// A sensor that reports in every slot: a missing report says nothing about the measurement.
impl Deterministic<1> for PatternSensor {}

impl Scheme<1> for PatternSensor {
    type State = ();
    type Feedback = ();
    type Report = Bit;
    type Factor = Scalar;

    fn start(&self) {}

    fn feedback_format(&self) {}

    fn report_format(&self) {}

    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        measurement: &SVector<f64, 1>,
        (): &(),
    ) -> Result<Option<Bit>, fewbits_core::Error> {
        Ok(Some(self.quantizer().report(measurement[0])?))
    }

    fn factor(&self, (): &(), observation: &Observation<Bit>, link: &Link) -> Result<Scalar, fewbits_core::Error> {
        let Bit(bit) = match observation {
            Observation::Received(bit) => *bit,
            missing => return Ok(Constant::of_delivery(missing, link).into()),
        };
        let arrival = link.of_received()?;
        let cells = Quantizer::try_from(self.quantizer())?;
        let variance = self.noise_std() * self.noise_std();
        let given = |level: usize| arrival * link.word_probability(level as u64, u64::from(bit), 1);
        Ok(cells.factor_of(variance, given)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Gaussian;
    use fewbits_core::laws::{factor, message, scheme};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_bit_takes_one_bit() {
        for bit in [Bit(false), Bit(true)] {
            assert_eq!(message::round_trip(&bit, &()).unwrap(), 1);
            assert!(message::decoding_is_total::<Bit>(&bit.to_bits(&()).unwrap(), &()));
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
                let bits = [Bit(false), Bit(true)];
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
                        let log = sensor.log_probabilities(0.4 * scale)[usize::from(bit.0)];
                        assert!((received.log_likelihood(&SVector::from([0.4 * scale])) - log).abs() < 1e-12);
                    }
                }
            }
            assert!(sensor.quantizer().report(f64::NAN).is_err());
        }
    }
}
