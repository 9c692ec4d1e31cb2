//! The sensor's half of a quantized range, and the likelihood of its levels.

use crate::Error;
use crate::factor::RangeFactor;
use crate::sensor::RangeNoise;
use fewbits_core::rand::Rng;
use fewbits_core::{
    BitReader, BitWriter, Cell, CodecError, Deterministic, Gaussian, Link, MeasurementNoise, Message, NumberFormat,
    Observation, Scheme,
};
use fewbits_numerics::error::refuse;
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_quantizers::{Labelling, Symbol};
use nalgebra::{Matrix1, Vector1, Vector2};
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

    pub(crate) fn check(&self) -> Result<(), ArgumentError> {
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
    /// Number format of a broadcast reference.
    format: NumberFormat,
    interval: IntervalRule,
}

/// The finite interval from which message passing draws for a received level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IntervalRule {
    /// The cell: `centre + half_width (q -+ Delta / 2)`.
    #[default]
    Correct,
    /// Equation 3.18 as printed, `centre (1 + q -+ Delta / 2)`: scaled by the range and not by its innovation (erratum `mpa-1`).
    Printed,
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
            format: NumberFormat::Single,
            interval: IntervalRule::Correct,
        })
    }

    /// The same sensor with another interval for message passing. Factors use the true cell.
    #[must_use]
    pub fn with_interval(self, interval: IntervalRule) -> Self {
        Self { interval, ..self }
    }

    /// The same sensor with other code words, such as a Gray code.
    #[must_use]
    pub fn with_labelling(self, labelling: Labelling) -> Self {
        Self { labelling, ..self }
    }

    /// The same sensor with another number format of a broadcast reference.
    #[must_use]
    pub fn with_format(self, format: NumberFormat) -> Self {
        Self { format, ..self }
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

    /// The likelihood of a level that arrived without inverted bits. `share` is the probability of arrival.
    fn cell_factor(&self, level: usize, reference: &RangeReference, share: f64) -> Result<RangeFactor, ArgumentError> {
        let (levels, nominal) = (self.levels(), reference.nominal_cell(level, self.levels())?);
        let lower = if level == 0 { f64::NEG_INFINITY } else { nominal.lower() };
        let upper = if level + 1 == levels {
            f64::INFINITY
        } else {
            nominal.upper()
        };
        let drawn_from = match self.interval {
            IntervalRule::Correct => [nominal.lower(), nominal.upper()],
            IntervalRule::Printed => [level, level + 1].map(|q| reference.centre * 2.0 * q as f64 / levels as f64),
        };
        RangeFactor::in_cell(Cell::new(lower, upper)?, drawn_from, share, self.noise)
    }

    /// The likelihood of a received level over a perfect link.
    ///
    /// # Errors
    /// If there is no such level, or the reference is not valid.
    pub fn received(&self, level: Symbol, reference: &RangeReference) -> Result<RangeFactor, ArgumentError> {
        self.cell_factor(level.0, reference, 1.0)
    }
}

impl MeasurementNoise<1> for QuantizedRange {
    fn noise_covariance_at(&self, range: &Vector1<f64>) -> Matrix1<f64> {
        let deviation = self.noise.deviation(range[0]);
        Matrix1::new(deviation * deviation)
    }
}

impl Deterministic<1> for QuantizedRange {}

impl Scheme<1> for QuantizedRange {
    type State = ();
    type Feedback = RangeReference;
    type Report = Symbol;
    type Factor = RangeFactor;

    fn feedback_format(&self) -> NumberFormat {
        self.format
    }

    fn report_format(&self) -> Labelling {
        self.labelling.clone()
    }

    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &Vector1<f64>,
        reference: &RangeReference,
    ) -> Result<Option<Symbol>, Error> {
        Ok(Some(self.level(measurement[0], reference)?))
    }

    fn factor(
        &self,
        reference: &RangeReference,
        observation: &Observation<Symbol>,
        link: &Link,
    ) -> Result<RangeFactor, Error> {
        let symbol = match observation {
            Observation::Received(symbol) => *symbol,
            missing => return Ok(RangeFactor::constant(link.delivery(missing), self.noise)?),
        };
        if link.crossover() == 0.0 {
            return Ok(self.cell_factor(symbol.0, reference, link.of_received()?)?);
        }
        reference.check()?;
        // Inverted bits: the mixture over all levels, each with the probability that its word became the received one.
        let (levels, given) = (self.levels(), self.labelling.given_levels(symbol, link)?);
        let edges = (0..=levels).map(|q| reference.edge(q, levels)).collect();
        Ok(RangeFactor::levels(edges, given, self.noise))
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
