//! The sensor's half of a quantized range, and how all nodes agree on its cells.

use crate::Error;
use crate::error::refuse;
use crate::factor::RangeFactor;
use crate::sensor::RangeNoise;
use crate::target::Target;
use fewbits_core::{
    BitReader, BitWriter, Cell, CodecError, Gaussian, Link, MeasurementNoise, Message, NumberFormat, Observation,
    Scheme, Sensing,
};
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_numerics::normal;
use fewbits_quantizers::{Labelling, Symbol};
use nalgebra::{Matrix1, Vector1};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Where the cells of a quantized range lie: `L` equal cells on `centre +- half_width`, the first and the last continued to
/// infinity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeReference {
    /// The reference range, in the middle of the cells.
    pub centre: f64,
    /// `N_f`, the range of an innovation of one; above zero.
    pub half_width: f64,
}

impl RangeReference {
    /// Edge `q` of `levels` cells, of `levels + 1`.
    #[inline]
    fn edge(&self, q: usize, levels: usize) -> f64 {
        self.centre + self.half_width * (2.0 * q as f64 / levels as f64 - 1.0)
    }

    fn check(&self) -> Result<(), ArgumentError> {
        finite("centre", self.centre)?;
        positive("half_width", self.half_width).map(|_| ())
    }

    /// The cell of a level with both ends finite: what the decoded interval is.
    ///
    /// # Errors
    /// If the level is not below `levels`, the reference is none, or rounding closes the cell.
    pub fn nominal_cell(&self, level: usize, levels: usize) -> Result<Cell, Error> {
        self.check()?;
        if level >= levels {
            return refuse("level", level, format!("a level below {levels}"));
        }
        Ok(Cell::new(self.edge(level, levels), self.edge(level + 1, levels))?)
    }
}

impl Message for RangeReference {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        format.write(self.centre, writer)?;
        format.write(self.half_width, writer)
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let centre = format.read(reader)?;
        Ok(Self {
            centre,
            half_width: format.read(reader)?,
        })
    }
}

/// A sensor that reports in which of `L` equal cells around a reference its range lies: a [`Scheme`], so that every filter of
/// the library tracks with it.
///
/// The innovation `I = (z - centre) / half_width` takes the cell `clamp(floor((I + 1) L / 2), 0, L - 1)`; a range on an edge
/// belongs to the cell above. The reference is the scheme's feedback. Nodes that receive all reports and run the same
/// deterministic filter compute it themselves and pay nothing for it ([`Encoder`]); otherwise it is broadcast.
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
    /// How a broadcast reference travels.
    format: NumberFormat,
    interval: IntervalRule,
}

/// Which finite interval message passing draws from when it receives a level.
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
    /// Unless there are 2 to 65536 levels.
    pub fn new(levels: usize, noise: RangeNoise) -> Result<Self, Error> {
        Ok(Self {
            labelling: Labelling::natural(levels)?,
            noise,
            format: NumberFormat::Single,
            interval: IntervalRule::Correct,
        })
    }

    /// The same with another interval for message passing; factors keep the true cell.
    #[must_use]
    pub fn with_interval(self, interval: IntervalRule) -> Self {
        Self { interval, ..self }
    }

    /// The same with other words on the wire, such as those of a Gray code.
    #[must_use]
    pub fn with_labelling(self, labelling: Labelling) -> Self {
        Self { labelling, ..self }
    }

    /// The same with another format of a broadcast reference.
    #[must_use]
    pub fn with_format(self, format: NumberFormat) -> Self {
        Self { format, ..self }
    }

    /// `L`.
    pub fn levels(&self) -> usize {
        self.labelling.levels()
    }

    /// Bits of a report.
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
    /// If the range is not finite, or the reference is none.
    pub fn level(&self, range: f64, reference: &RangeReference) -> Result<Symbol, ArgumentError> {
        finite("range", range)?;
        reference.check()?;
        let levels = self.levels();
        let share = ((range - reference.centre) / reference.half_width + 1.0) * 0.5 * levels as f64;
        let mut level = (share.floor().max(0.0) as usize).min(levels - 1);
        // Rounding must not part the level from the edges that the factor knows.
        while level + 1 < levels && range >= reference.edge(level + 1, levels) {
            level += 1;
        }
        while level > 0 && range < reference.edge(level, levels) {
            level -= 1;
        }
        Ok(Symbol(level))
    }

    /// What a level that arrived unharmed with probability `share` says.
    fn cell_factor(&self, level: usize, reference: &RangeReference, share: f64) -> Result<RangeFactor, Error> {
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

    /// What a received level says, over a perfect link.
    ///
    /// # Errors
    /// If there is no such level, or the reference is none.
    pub fn received(&self, level: Symbol, reference: &RangeReference) -> Result<RangeFactor, Error> {
        self.cell_factor(level.0, reference, 1.0)
    }
}

/// What a scheme reports.
pub(crate) fn reported(error: Error) -> fewbits_core::Error {
    match error {
        Error::Argument(error) => error.into(),
        Error::Core(error) => error,
        other => ArgumentError::new("reference", other, "a reference of a quantized range").into(),
    }
}

impl MeasurementNoise<1> for QuantizedRange {
    fn noise_covariance_at(&self, range: &Vector1<f64>) -> Matrix1<f64> {
        let deviation = self.noise.deviation(range[0]);
        Matrix1::new(deviation * deviation)
    }
}

impl Scheme<1> for QuantizedRange {
    type State = ();
    type Feedback = RangeReference;
    type Report = Symbol;
    type Factor = RangeFactor;

    fn start(&self) {}

    fn feedback_format(&self) -> NumberFormat {
        self.format
    }

    fn report_format(&self) -> Labelling {
        self.labelling.clone()
    }

    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        measurement: &Vector1<f64>,
        reference: &RangeReference,
    ) -> Result<Option<Symbol>, fewbits_core::Error> {
        Ok(Some(self.level(measurement[0], reference)?))
    }

    fn factor(
        &self,
        reference: &RangeReference,
        observation: &Observation<Symbol>,
        link: &Link,
    ) -> Result<RangeFactor, fewbits_core::Error> {
        let symbol = match observation {
            Observation::Received(symbol) => *symbol,
            missing => return RangeFactor::constant(link.delivery(missing), self.noise).map_err(reported),
        };
        let arrives = link.of_received()?;
        if link.crossover() == 0.0 {
            return self.cell_factor(symbol.0, reference, arrives).map_err(reported);
        }
        reference.check()?;
        let (levels, word) = (self.levels(), |symbol: usize| self.labelling.word(symbol).map(u64::from));
        let Some(received) = word(symbol.0) else {
            let expected = format!("a symbol below {}", self.labelling.symbols());
            return Err(ArgumentError::new("symbol", symbol.0, expected).into());
        };
        let given = |level: usize| {
            let sent = word(level).unwrap_or(received);
            arrives * link.word_probability(sent, received, self.bits())
        };
        let edges = (0..=levels).map(|q| reference.edge(q, levels)).collect();
        Ok(RangeFactor::levels(edges, (0..levels).map(given).collect(), self.noise))
    }
}

/// Terms of the published normalisation `N_f` (3.13), whose last one is dimensionally inconsistent (erratum `mpa-2`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normalisation {
    /// `ts V + ts^2 g / 2 + 5 (ts^2 / 2) sigma_v`, as printed.
    #[default]
    Printed,
    /// `ts V + ts^2 g / 2 + 5 (ts^2 / 2) sigma_u`: the process noise in its place.
    Process,
    /// The same plus `5 sigma_v`.
    Robust,
}

/// How the nodes derive the reference of each range from the belief that all of them hold. No bit is spent on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoder {
    /// The published one: the range of the *previous* estimate, and the normalisation of a target of at most this speed.
    Published {
        /// `V`, length per time.
        max_speed: f64,
        /// Which terms.
        normalisation: Normalisation,
    },
    /// The range of the *predicted* estimate with the published normalisation.
    Predicted {
        /// `V`, length per time.
        max_speed: f64,
        /// Which terms.
        normalisation: Normalisation,
    },
    /// The range of the predicted estimate, and `loading` standard deviations of the innovation:
    /// `N_f = loading sqrt(h' P h + sigma^2)`. See [`optimal_loading`].
    Adaptive {
        /// Standard deviations from the centre to the outermost nominal edge.
        loading: f64,
    },
}

impl Encoder {
    /// The published encoder, checked.
    ///
    /// # Errors
    /// If the speed is not above zero.
    pub fn published(max_speed: f64) -> Result<Self, Error> {
        Ok(Self::Published {
            max_speed: positive("max_speed", max_speed)?,
            normalisation: Normalisation::Printed,
        })
    }

    /// The published normalisation around the predicted range, checked.
    ///
    /// # Errors
    /// If the speed is not above zero.
    pub fn predicted(max_speed: f64) -> Result<Self, Error> {
        Ok(Self::Predicted {
            max_speed: positive("max_speed", max_speed)?,
            normalisation: Normalisation::Printed,
        })
    }

    /// The adaptive encoder with the best loading for `levels` cells.
    ///
    /// # Errors
    /// If there are fewer than two levels.
    pub fn adaptive(levels: usize) -> Result<Self, Error> {
        Ok(Self::Adaptive {
            loading: optimal_loading(levels)?,
        })
    }

    /// The published `N_f` at a reference range.
    pub fn normaliser(target: &Target, noise: &RangeNoise, max_speed: f64, which: Normalisation, range: f64) -> f64 {
        let (half, sigma_v) = (0.5 * target.interval() * target.interval(), noise.deviation(range));
        let sigma_u = target.noise_variance().sqrt();
        let reach = target.interval() * max_speed + half * target.chain().magnitude();
        match which {
            Normalisation::Printed => reach + 5.0 * half * sigma_v,
            Normalisation::Process => reach + 5.0 * half * sigma_u,
            Normalisation::Robust => reach + 5.0 * half * sigma_u + 5.0 * sigma_v,
        }
    }

    /// The reference of a sensor: from the estimate of the step before and its prediction, which every node has.
    ///
    /// # Errors
    /// If the beliefs or the settings give no number.
    pub fn reference<const D: usize>(
        &self,
        target: &Target,
        sensor: &impl Sensing<D, 1>,
        noise: &RangeNoise,
        previous: &Gaussian<D>,
        predicted: &Gaussian<D>,
    ) -> Result<RangeReference, Error> {
        let about = match self {
            Self::Published { .. } => previous,
            Self::Predicted { .. } | Self::Adaptive { .. } => predicted,
        };
        let centre = sensor.mean(about.mean())[0];
        let half_width = match *self {
            Self::Published {
                max_speed,
                normalisation,
            }
            | Self::Predicted {
                max_speed,
                normalisation,
            } => Self::normaliser(target, noise, max_speed, normalisation, centre),
            Self::Adaptive { loading } => {
                let row = sensor.jacobian(about.mean());
                let spread = (row * about.covariance() * row.transpose())[0].max(0.0);
                loading * libm::hypot(spread.sqrt(), noise.deviation(centre))
            }
        };
        let reference = RangeReference { centre, half_width };
        reference.check()?;
        Ok(reference)
    }
}

/// Standard deviations from the mean to the outermost edge of the uniform quantizer of least squared error for a normal
/// variable: 1.596, 1.991, 2.344, 2.682 for 2, 4, 8, 16 levels.
///
/// # Errors
/// If there are fewer than two levels or more than 65536.
pub fn optimal_loading(levels: usize) -> Result<f64, Error> {
    if !(2..=65_536).contains(&levels) {
        return refuse("levels", levels, "2 to 65536 levels");
    }
    // Squared error of reconstructing each cell by its nominal middle; the cells are symmetric.
    let error = |loading: f64| {
        let width = 2.0 * loading / levels as f64;
        let cell = |q: usize| {
            let lower = if q == 0 {
                f64::NEG_INFINITY
            } else {
                q as f64 * width - loading
            };
            let upper = if q + 1 == levels {
                f64::INFINITY
            } else {
                (q + 1) as f64 * width - loading
            };
            let middle = (q as f64 + 0.5) * width - loading;
            let moments = normal::truncated_moments(lower, upper).ok();
            let squared = moments.map_or(0.0, |m| m.variance + (m.mean - middle) * (m.mean - middle));
            normal::log_interval(lower, upper).exp() * squared
        };
        (0..levels).map(cell).sum::<f64>()
    };
    // Unimodal: golden section.
    const SHARE: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (0.5, 12.0);
    let (mut a, mut b) = (high - SHARE * (high - low), low + SHARE * (high - low));
    let (mut at_a, mut at_b) = (error(a), error(b));
    for _ in 0..48 {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - SHARE * (high - low);
            at_a = error(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + SHARE * (high - low);
            at_b = error(b);
        }
    }
    Ok(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_loading_is_the_textbook_one() {
        for (levels, known) in [(2, 1.596), (4, 1.991), (8, 2.344), (16, 2.682)] {
            assert!((optimal_loading(levels).unwrap() - known).abs() < 1e-3, "{levels}");
        }
        // Two levels by hand: twice the mean of a half-normal variable.
        let exact = 2.0 * (2.0 / std::f64::consts::PI).sqrt();
        assert!((optimal_loading(2).unwrap() - exact).abs() < 1e-7);
        assert!(optimal_loading(1).is_err() && optimal_loading(0).is_err());
    }

    #[test]
    fn ties_go_up_and_beyond_the_ends_it_saturates() {
        let scheme = QuantizedRange::new(4, RangeNoise::constant(0.1).unwrap()).unwrap();
        let reference = RangeReference {
            centre: 5.0,
            half_width: 2.0,
        };
        let levels = [-1e300, 2.9, 3.0, 4.0, 5.0, 6.999, 7.0, 1e300].map(|z| scheme.level(z, &reference).unwrap().0);
        assert_eq!(levels, [0, 0, 0, 1, 2, 3, 3, 3]);
        assert!(scheme.level(f64::NAN, &reference).is_err());
        let broken = RangeReference {
            centre: 5.0,
            half_width: 0.0,
        };
        assert!(scheme.level(5.0, &broken).is_err());
        assert!(scheme.received(Symbol(4), &reference).is_err());
        assert!(QuantizedRange::new(1, *scheme.noise()).is_err() && Encoder::published(0.0).is_err());
    }
}
