//! The sensor's half: compare, quantize, speak. No model, no memory, no allocation.

use crate::Error;
use fewbits_core::{BitReader, BitWriter, Cell, CodecError, Encoder, Message, Sign};
use fewbits_numerics::error::{ArgumentError, positive};
use fewbits_quantizers::lloyd_max::{LloydMax, gaussian_table};

/// A sensor that says whether its sample reached the broadcast threshold: one bit.
///
/// The feedback is the threshold, for the Dymbo filter the fusion centre's prediction `a theta_hat(n-1)` of the present
/// state. (Equation (14) of the paper prints `theta_hat(n-1)`; see erratum E1.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OneBitSensor;

impl Encoder for OneBitSensor {
    type Measurement = f64;
    type Feedback = f64;
    type Message = Sign;

    #[inline]
    fn encode(&self, measurement: &f64, threshold: &f64) -> Sign {
        Sign::of(*measurement, *threshold)
    }
}

/// What the fusion centre broadcasts to sensors that send several bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Predicted measurement.
    pub mean: f64,
    /// Standard deviation of the innovation, `sqrt(P + sigma^2)`.
    pub deviation: f64,
}

/// Index of a quantizer cell, counted from the lowest: the number of breakpoints at or below the normalised innovation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct CellIndex(pub u16);

impl Message for CellIndex {
    /// Word length in bits.
    type Format = u32;

    fn encode(&self, bits: &u32, writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(self.0), *bits)
    }

    fn decode(bits: &u32, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let index = reader.read(*bits)?;
        u16::try_from(index).map(Self).map_err(|_| CodecError::Invalid {
            what: "cell index",
            value: index.to_string(),
            expected: "at most 65535",
        })
    }
}

/// A sensor that sends the cell of its normalised innovation in the Lloyd-Max quantizer of the standard normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultibitSensor {
    bits: u32,
    quantizer: &'static LloydMax,
}

impl MultibitSensor {
    /// A sensor with a word of 1 to 8 bits.
    ///
    /// # Errors
    /// Any other word length.
    pub fn new(bits: usize) -> Result<Self, Error> {
        let quantizer = gaussian_table(bits)?;
        Ok(Self {
            bits: bits as u32,
            quantizer,
        })
    }

    /// Word length: the format of the messages.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// The quantizer of the normalised innovation.
    pub fn quantizer(&self) -> &'static LloydMax {
        self.quantizer
    }

    /// Reconstruction value of a cell in innovation standard deviations.
    ///
    /// # Errors
    /// An index beyond the last cell.
    #[inline]
    pub fn centroid(&self, index: CellIndex) -> Result<f64, Error> {
        let centroids = self.quantizer.centroids();
        centroids
            .get(usize::from(index.0))
            .copied()
            .ok_or_else(|| self.refusal(index))
    }

    /// The cell of an index, in measurement units around a prediction.
    ///
    /// # Errors
    /// An index beyond the last cell; a prediction so large that rounding closes the cell.
    pub fn cell(&self, index: CellIndex, prediction: &Prediction) -> Result<Cell, Error> {
        self.centroid(index)?;
        let edges = self.quantizer.breakpoints();
        let at = usize::from(index.0);
        let place = |z: f64| prediction.mean + prediction.deviation * z;
        let low = if at == 0 {
            f64::NEG_INFINITY
        } else {
            place(edges[at - 1])
        };
        Ok(Cell::new(low, edges.get(at).map_or(f64::INFINITY, |z| place(*z)))?)
    }

    fn refusal(&self, index: CellIndex) -> Error {
        ArgumentError::new("index", index.0, format!("a cell index below {}", 1 << self.bits)).into()
    }
}

impl Encoder for MultibitSensor {
    type Measurement = f64;
    type Feedback = Prediction;
    type Message = CellIndex;

    #[inline]
    fn encode(&self, measurement: &f64, prediction: &Prediction) -> CellIndex {
        let innovation = (measurement - prediction.mean) / prediction.deviation;
        let below = self.quantizer.breakpoints().partition_point(|edge| *edge <= innovation);
        CellIndex(below as u16)
    }
}

/// The first message: the sample, rounded to a multiple of the resolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct FineMessage(pub i64);

impl Message for FineMessage {
    /// Word length in bits; the multiple is sent in two's complement.
    type Format = u32;

    fn encode(&self, bits: &u32, writer: &mut BitWriter) -> Result<(), CodecError> {
        let spare = 64_u32
            .checked_sub(*bits)
            .ok_or(CodecError::FieldTooWide { width: *bits })?;
        let word = (self.0 as u64).checked_shl(spare).unwrap_or(0);
        if (word as i64).checked_shr(spare).unwrap_or(0) != self.0 {
            return Err(CodecError::ValueTooLarge {
                value: self.0.unsigned_abs(),
                width: *bits,
            });
        }
        writer.write(word.checked_shr(spare).unwrap_or(0), *bits)
    }

    fn decode(bits: &u32, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let word = reader.read(*bits)?;
        // `read` has refused words above 64 bits.
        let spare = 64 - *bits;
        Ok(Self(
            (word.checked_shl(spare).unwrap_or(0) as i64)
                .checked_shr(spare)
                .unwrap_or(0),
        ))
    }
}

/// A sensor that sends its first sample finely: `round(x/tau)`, halves away from zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FineSensor {
    resolution: f64,
}

impl FineSensor {
    /// A sensor with resolution `tau > 0` in measurement units.
    ///
    /// # Errors
    /// Any other resolution.
    pub fn new(resolution: f64) -> Result<Self, Error> {
        Ok(Self {
            resolution: positive("resolution", resolution)?,
        })
    }

    /// `tau`.
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// The value that a message stands for, `tau` times its multiple.
    #[inline]
    pub fn value(&self, message: FineMessage) -> f64 {
        self.resolution * message.0 as f64
    }

    /// The cell of samples that a message stands for.
    ///
    /// # Errors
    /// A multiple so large that neighbouring cells coincide.
    pub fn cell(&self, message: FineMessage) -> Result<Cell, Error> {
        let edge = |offset: f64| self.resolution * (message.0 as f64 + offset);
        Ok(Cell::new(edge(-0.5), edge(0.5))?)
    }
}

impl Encoder for FineSensor {
    type Measurement = f64;
    type Feedback = ();
    type Message = FineMessage;

    /// Multiples beyond the range of 64 bits saturate; NaN becomes 0.
    #[inline]
    fn encode(&self, measurement: &f64, (): &()) -> FineMessage {
        FineMessage((measurement / self.resolution).round() as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::{CellIndex, FineMessage, FineSensor, MultibitSensor, OneBitSensor, Prediction};
    use fewbits_core::message::laws;
    use fewbits_core::{Encoder, Message, Sign};
    use proptest::prelude::*;

    #[test]
    fn a_bit_costs_a_bit_and_ties_are_above() {
        let bit = OneBitSensor.encode(&0.3, &0.3);
        assert_eq!(bit, Sign::Above);
        assert_eq!(bit.to_bits(&()).unwrap().bits(), 1);
        assert_eq!(OneBitSensor.encode(&0.29, &0.3), Sign::Below);
    }

    proptest! {
        #[test]
        fn words_keep_their_length(bits in 1_usize..=8, x in -20.0..20.0_f64, mean in -5.0..5.0_f64, deviation in 0.1..4.0_f64) {
            let sensor = MultibitSensor::new(bits).unwrap();
            let prediction = Prediction { mean, deviation };
            let word = sensor.encode(&x, &prediction);
            prop_assert_eq!(laws::round_trip(&word, &sensor.bits()).unwrap(), bits);
            let cell = sensor.cell(word, &prediction).unwrap();
            // Rounding of the two maps may part at an edge.
            prop_assert!(cell.lower() <= x + 1e-12 && x <= cell.upper() + 1e-12);
            let centre = mean + deviation * sensor.centroid(word).unwrap();
            prop_assert!(cell.contains(centre));
        }

        #[test]
        fn fine_messages_round_trip(multiple in -2048_i64..2048) {
            prop_assert_eq!(laws::round_trip(&FineMessage(multiple), &12).unwrap(), 12);
            prop_assert_eq!(FineMessage(multiple).to_bits(&11).is_ok(), (-1024..1024).contains(&multiple));
            let sensor = FineSensor::new(0.25).unwrap();
            prop_assert_eq!(sensor.encode(&sensor.value(FineMessage(multiple)), &()), FineMessage(multiple));
        }
    }

    #[test]
    fn one_bit_words_are_sign_bits() {
        let sensor = MultibitSensor::new(1).unwrap();
        let prediction = Prediction {
            mean: 1.0,
            deviation: 2.0,
        };
        assert_eq!(sensor.encode(&1.0, &prediction), CellIndex(1));
        assert_eq!(sensor.encode(&0.999, &prediction), CellIndex(0));
        assert!(sensor.cell(CellIndex(2), &prediction).is_err());
        assert!(MultibitSensor::new(0).is_err() && MultibitSensor::new(9).is_err());
    }

    #[test]
    fn halves_round_away_from_zero() {
        let sensor = FineSensor::new(1.0).unwrap();
        assert_eq!((sensor.encode(&0.5, &()).0, sensor.encode(&-0.5, &()).0), (1, -1));
        assert!(FineSensor::new(0.0).is_err() && FineSensor::new(f64::NAN).is_err());
        assert!(FineMessage(0).to_bits(&65).is_err());
        assert_eq!(FineMessage(i64::MIN).to_bits(&64).unwrap().bits(), 64);
        assert_eq!(FineMessage(0).to_bits(&0).unwrap().bits(), 0);
        assert!(sensor.cell(FineMessage(i64::MAX)).is_err());
    }
}
