//! Several bits per sample: the index of the quantizer cell of the normalised innovation.

use crate::Error;
use fewbits_core::{BitReader, BitWriter, Cell, CodecError, Gaussian, Message, Noise, NumberFormat, Quantized};
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_quantizers::lloyd_max::{LloydMax, gaussian_table};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// What the fusion centre broadcasts to sensors that report several bits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prediction {
    /// Predicted measurement.
    pub mean: f64,
    /// Standard deviation of the innovation, `sqrt(P + sigma^2)`.
    pub deviation: f64,
}

impl Prediction {
    fn check(&self) -> Result<(), ArgumentError> {
        finite("prediction", self.mean)?;
        positive("deviation", self.deviation).map(|_| ())
    }
}

/// The prediction of the measurement from a belief of the measurement: mean and standard deviation. The noise must be included.
impl From<&Gaussian<1>> for Prediction {
    fn from(measurement: &Gaussian<1>) -> Self {
        Self {
            mean: measurement.mean()[0],
            deviation: measurement.covariance()[0].sqrt(),
        }
    }
}

impl Message for Prediction {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        Vector2::new(self.mean, self.deviation).encode(format, writer)
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let [mean, deviation] = Vector2::decode(format, reader)?.into();
        Ok(Self { mean, deviation })
    }
}

/// Index of a quantizer cell, counted from the lowest: the number of breakpoints at or below the normalised innovation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CellIndex(pub u16);

impl Message for CellIndex {
    /// Word length in bits.
    type Format = u32;

    fn encode(&self, bits: &u32, writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(self.0), *bits)
    }

    fn decode(bits: &u32, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let index = reader.read(*bits)?;
        let word = u16::try_from(index).map(Self);
        word.map_err(|_| CodecError::invalid("cell index", index, "at most 65535"))
    }
}

/// A sensor that reports the cell of its normalised innovation in the Lloyd-Max quantizer of the standard normal density.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct InnovationWord {
    noise_variance: f64,
    bits: u32,
    #[serde(skip_serializing)]
    quantizer: &'static LloydMax,
}

/// The stored form of [`InnovationWord`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    noise_variance: f64,
    bits: u32,
}

impl TryFrom<Numbers> for InnovationWord {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        InnovationWord::new(parts.noise_variance, parts.bits as usize)
    }
}

impl InnovationWord {
    /// A sensor with measurement variance `sigma^2 > 0` and words of 1 to 8 bits.
    ///
    /// # Errors
    /// If the variance is not positive, or for any other word length.
    pub fn new(noise_variance: f64, bits: usize) -> Result<Self, Error> {
        Ok(Self {
            noise_variance: positive("noise_variance", noise_variance)?,
            quantizer: gaussian_table(bits)?,
            bits: bits as u32,
        })
    }

    /// Word length in bits, which is the format of the reports.
    pub(crate) fn bits(&self) -> u32 {
        self.bits
    }

    /// The quantizer of the normalised innovation.
    pub(crate) fn quantizer(&self) -> &'static LloydMax {
        self.quantizer
    }

    /// The word as an index into the quantizer's tables; an error beyond the last cell.
    pub(crate) fn index(&self, index: CellIndex) -> Result<usize, ArgumentError> {
        let at = usize::from(index.0);
        if at < self.quantizer.centroids().len() {
            return Ok(at);
        }
        Err(ArgumentError::new("index", index.0, format!("a cell index below {}", 1 << self.bits)))
    }

    fn centred(&self, prediction: &Prediction) -> Result<Vec<f64>, ArgumentError> {
        prediction.check()?;
        let edges = self.quantizer.breakpoints().iter();
        Ok(edges.map(|z| prediction.mean + prediction.deviation * z).collect())
    }
}

impl Quantized for InnovationWord {
    type Feedback = Prediction;
    type Report = CellIndex;

    fn format_of_feedback(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn format_of_report(&self) -> u32 {
        self.bits
    }

    fn measurement_noise(&self) -> Noise {
        self.noise_variance.into()
    }

    fn check(&self, prediction: &Prediction) -> Result<(), Error> {
        Ok(prediction.check()?)
    }

    #[inline]
    fn report_of(&self, measurement: f64, prediction: &Prediction) -> Result<CellIndex, Error> {
        let thresholds = self.quantizer.breakpoints();
        let below = fewbits_node::innovation_cell(thresholds, measurement, prediction.mean, prediction.deviation);
        Ok(CellIndex(below.map_err(ArgumentError::from)? as u16))
    }

    fn edges(&self, prediction: &Prediction) -> Result<Vec<f64>, Error> {
        Ok(self.centred(prediction)?)
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        0..1_u64 << self.bits
    }

    fn word_of(&self, index: &CellIndex) -> Result<u64, Error> {
        Ok(self.index(*index)? as u64)
    }

    fn word_bits(&self) -> u32 {
        self.bits
    }

    /// Fails too if the mean is so large that the cell's ends coincide.
    fn only_cell(&self, index: &CellIndex, prediction: &Prediction) -> Result<Option<Cell>, Error> {
        let (edges, at) = (self.centred(prediction)?, self.index(*index)?);
        let lower = if at == 0 { f64::NEG_INFINITY } else { edges[at - 1] };
        Ok(Some(Cell::new(lower, edges.get(at).copied().unwrap_or(f64::INFINITY))?))
    }
}

#[cfg(test)]
mod tests {
    use super::{CellIndex, InnovationWord, Prediction};
    use fewbits_core::Quantized;
    use fewbits_core::laws::message::round_trip;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn words_keep_their_length(bits in 1_usize..=8, x in -20.0..20.0_f64, mean in -5.0..5.0_f64, deviation in 0.1..4.0_f64) {
            let scheme = InnovationWord::new(1.0, bits).unwrap();
            let prediction = Prediction { mean, deviation };
            let word = scheme.report_of(x, &prediction).unwrap();
            prop_assert_eq!(round_trip(&word, &scheme.bits()).unwrap(), bits);
            let cell = scheme.only_cell(&word, &prediction).unwrap().unwrap();
            // Rounding of the two maps may part at an edge.
            prop_assert!(cell.lower() <= x + 1e-12 && x <= cell.upper() + 1e-12);
            let centroid = scheme.quantizer().centroids()[usize::from(word.0)];
            prop_assert!(cell.contains(mean + deviation * centroid));
        }
    }

    #[test]
    fn one_bit_words_are_sign_bits() {
        let scheme = InnovationWord::new(1.0, 1).unwrap();
        let prediction = Prediction {
            mean: 1.0,
            deviation: 2.0,
        };
        assert_eq!(scheme.report_of(1.0, &prediction), Ok(CellIndex(1)));
        assert_eq!(scheme.report_of(0.999, &prediction), Ok(CellIndex(0)));
        assert!(scheme.only_cell(&CellIndex(2), &prediction).is_err());
        assert!(InnovationWord::new(1.0, 0).is_err() && InnovationWord::new(1.0, 9).is_err());
        let json = serde_json::to_string(&scheme).unwrap();
        assert_eq!(serde_json::from_str::<InnovationWord>(&json).unwrap(), scheme);
        assert!(serde_json::from_str::<InnovationWord>(&json.replace('1', "9")).is_err());
    }
}
