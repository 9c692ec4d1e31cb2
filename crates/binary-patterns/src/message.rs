//! The message: one bit, on the wire and as a likelihood.

use super::{BinaryQuantizer, Sensor};
use fewbits_core::bits::{BitReader, BitWriter, CodecError};
use fewbits_core::{Likelihood, Message};
use nalgebra::SVector;

/// What a one-bit sensor says: the bit of the cell that holds its measurement. One bit on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
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

/// `ln P(bit | x)` for one coordinate of a state: how any filter hears a one-bit sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct HeardBit<'a, const D: usize> {
    sensor: &'a Sensor,
    row: SVector<f64, D>,
    bit: Bit,
}

impl<'a, const D: usize> HeardBit<'a, D> {
    /// The bit heard from a sensor that measures `row' x + noise`.
    ///
    /// # Errors
    /// If the row is not finite.
    pub fn new(sensor: &'a Sensor, row: SVector<f64, D>, bit: Bit) -> Result<Self, crate::Error> {
        fewbits_numerics::error::all_finite("row", row.as_slice())?;
        Ok(Self { sensor, row, bit })
    }
}

impl<const D: usize> Likelihood<D> for HeardBit<'_, D> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.sensor.log_probabilities(self.row.dot(state))[usize::from(self.bit.0)]
    }
}

impl BinaryQuantizer {
    /// The message of a measurement.
    ///
    /// # Errors
    /// If the measurement is NaN.
    pub fn message(&self, measurement: f64) -> Result<Bit, crate::Error> {
        self.encode(measurement).map(Bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::message::laws;

    #[test]
    fn a_bit_takes_one_bit() {
        for bit in [Bit(false), Bit(true)] {
            assert_eq!(laws::round_trip(&bit, &()).unwrap(), 1);
            assert!(laws::decoding_is_total::<Bit>(&bit.to_bits(&()).unwrap(), &()));
        }
    }

    #[test]
    fn likelihoods_of_both_bits_sum_to_one() {
        let sensor = Sensor::new(BinaryQuantizer::new(vec![-0.5, 0.5]).unwrap(), 0.3).unwrap();
        let state = SVector::from([0.2, -0.4]);
        let row = SVector::from([1.0, 0.5]);
        let [zero, one] = [false, true].map(|b| {
            HeardBit::new(&sensor, row, Bit(b))
                .unwrap()
                .log_likelihood(&state)
                .exp()
        });
        assert!((zero + one - 1.0).abs() < 1e-14 && one > 0.9);
        assert!(HeardBit::new(&sensor, SVector::from([f64::NAN]), Bit(true)).is_err());
        assert!(sensor.quantizer().message(f64::NAN).is_err());
    }
}
