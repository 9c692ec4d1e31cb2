//! The sensor's half of a quantized range, and the likelihood of its levels.

use crate::Error;
use fewbits_core::factor::Levels;
use fewbits_core::{
    BitReader, BitWriter, Cell, CodecError, Gaussian, Message, Noise, NumberFormat, Quantized, RangeNoise,
};
use fewbits_numerics::error::refuse;
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_quantizers::{Labelling, Symbol};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Where the cells of a quantized range lie: `L` equal cells on `centre +- half_width`. The first and the last extend to
/// infinity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeReference {
    /// The reference range, in the middle of the cells.
    pub centre: f64,
    /// Half-width `N_f` of the cells together; positive.
    pub half_width: f64,
}

impl RangeReference {
    /// The reference about an expected measurement: its mean, and `loading` of its standard deviations to either side
    /// ([`optimal_loading`](crate::optimal_loading)).
    pub fn about(expected: &Gaussian<1>, loading: f64) -> Self {
        Self {
            centre: expected.mean()[0],
            half_width: loading * expected.covariance()[0].sqrt(),
        }
    }

    /// Edge `q` of `levels` cells, `0 <= q <= levels`.
    #[inline]
    fn edge(&self, q: usize, levels: usize) -> f64 {
        fewbits_node::edge(q as u32, levels as u32, self.centre, self.half_width)
    }

    fn check(&self) -> Result<(), ArgumentError> {
        finite("centre", self.centre)?;
        positive("half_width", self.half_width).map(|_| ())
    }

    /// The cell of a level with both ends finite: the decoded interval.
    ///
    /// # Errors
    /// If the level is not below `levels`, the reference is not valid, or the ends of the cell coincide after rounding.
    pub fn nominal_cell(&self, level: usize, levels: usize) -> Result<Cell, ArgumentError> {
        self.check()?;
        if level >= levels {
            return refuse("level", level, format!("a level below {levels}"));
        }
        Cell::new(self.edge(level, levels), self.edge(level + 1, levels))
    }
}

/// A reference is rounded to the format as it is encoded, so that one from a belief ([`RangeReference::about`]) can be told. Both halves use
/// what is decoded.
impl Message for RangeReference {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        // What has no rounded value is refused below.
        let rounded = |x: f64| format.rounded(x).unwrap_or(x);
        Vector2::new(self.centre, self.half_width)
            .map(rounded)
            .encode(format, writer)
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let [centre, half_width] = Vector2::decode(format, reader)?.into();
        Ok(Self { centre, half_width })
    }
}

/// A sensor that reports in which of `L` equal cells around a reference its range lies. It is a [`Scheme`](fewbits_core::Scheme), so every
/// filter of the library accepts its reports.
///
/// The innovation `I = (z - centre) / half_width` is in the cell `clamp(floor((I + 1) L / 2), 0, L - 1)`; a range on an edge
/// belongs to the cell above. The reference is the scheme's feedback. Nodes that receive all reports and run the same
/// deterministic filter compute it themselves without communication; otherwise it is broadcast.
///
/// ```
/// use fewbits_core::factor::Factor;
/// use fewbits_core::{Gaussian, Link, Observation, Scheme};
/// use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference};
/// let scheme = QuantizedRange::new(4, RangeNoise::from_snr_db(50.0)?)?;
/// let reference = RangeReference { centre: 5.2, half_width: 3.05 };
/// let level = scheme.level(4.9, &reference)?;
/// let received = scheme.factor(&reference, &Observation::Received(level), &Link::PERFECT)?;
/// let posterior = received.tilted(&Gaussian::scalar(5.0, 1.0)?)?;
/// assert!(posterior.mean[0] < 5.0 && posterior.covariance[0] < 0.3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuantizedRange {
    labelling: Labelling,
    noise: RangeNoise,
}

impl QuantizedRange {
    /// A sensor with `levels` cells and the given noise; a reference that is broadcast costs 64 bits.
    ///
    /// # Errors
    /// If `levels` is outside `2..=65536`.
    pub fn new(levels: usize, noise: RangeNoise) -> Result<Self, Error> {
        Ok(Self {
            labelling: Labelling::natural(levels)?,
            noise,
        })
    }

    /// Number of levels `L`.
    pub fn levels(&self) -> usize {
        self.labelling.levels()
    }

    /// Length of a report in bits.
    pub fn bits(&self) -> u32 {
        self.labelling.bits()
    }

    /// The noise of the range.
    pub fn noise(&self) -> &RangeNoise {
        &self.noise
    }

    /// The level of a range.
    ///
    /// # Errors
    /// If the range is not finite, or the reference is not valid.
    pub fn level(&self, range: f64, reference: &RangeReference) -> Result<Symbol, ArgumentError> {
        let level = fewbits_node::range_level(range, reference.centre, reference.half_width, self.levels() as u32)?;
        Ok(Symbol(level as usize))
    }

    /// The cell of a level, the first and the last unbounded.
    ///
    /// # Errors
    /// If there is no such level, or the reference is not valid.
    pub(crate) fn cell(&self, level: Symbol, reference: &RangeReference) -> Result<Cell, ArgumentError> {
        let nominal = reference.nominal_cell(level.0, self.levels())?;
        let (is_first, is_last) = (level.0 == 0, level.0 + 1 == self.levels());
        let lower = if is_first { f64::NEG_INFINITY } else { nominal.lower() };
        Cell::new(lower, if is_last { f64::INFINITY } else { nominal.upper() })
    }

    /// The likelihood of a received level over a perfect link.
    ///
    /// # Errors
    /// If there is no such level, or the reference is not valid.
    pub fn received(&self, level: Symbol, reference: &RangeReference) -> Result<Levels, ArgumentError> {
        Levels::certain(self.cell(level, reference)?, self.noise)
    }
}

impl Quantized for QuantizedRange {
    type Feedback = RangeReference;
    type Report = Symbol;

    fn format_of_feedback(&self) -> NumberFormat {
        NumberFormat::Single
    }

    fn format_of_report(&self) -> Labelling {
        self.labelling.clone()
    }

    fn measurement_noise(&self) -> Noise {
        self.noise.into()
    }

    fn check(&self, reference: &RangeReference) -> Result<(), Error> {
        Ok(reference.check()?)
    }

    fn report_of(&self, range: f64, reference: &RangeReference) -> Result<Symbol, Error> {
        Ok(self.level(range, reference)?)
    }

    fn edges(&self, reference: &RangeReference) -> Result<Vec<f64>, Error> {
        reference.check()?;
        let levels = self.levels();
        Ok((1..levels).map(|q| reference.edge(q, levels)).collect())
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        self.labelling.level_words()
    }

    fn word_of(&self, level: &Symbol) -> Result<u64, Error> {
        self.labelling.word_of(*level)
    }

    fn word_bits(&self) -> u32 {
        self.labelling.bits()
    }

    fn only_cell(&self, level: &Symbol, reference: &RangeReference) -> Result<Option<Cell>, Error> {
        Ok(Some(self.cell(*level, reference)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_up_and_beyond_the_ends_it_saturates() {
        let scheme = QuantizedRange::new(4, RangeNoise::constant(0.1).unwrap()).unwrap();
        let reference = RangeReference {
            centre: 5.0,
            half_width: 2.0,
        };
        let levels = [-1e300, 2.9, 3.0, 4.0, 5.0, 6.999, 7.0, 1e300].map(|z| scheme.level(z, &reference).unwrap().0);
        assert_eq!(levels, [0, 0, 0, 1, 2, 3, 3, 3]);
    }
}
