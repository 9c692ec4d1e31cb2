//! Scalar quantizers: breakpoints, and the level of each cell.

use crate::channel::Channel;
use crate::density::edges;
use crate::error::{Error, refuse};
use fewbits_core::Cell;
use fewbits_core::factor::{Constant, Levels, Scalar};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, entries, finite, positive};
use serde::{Deserialize, Serialize};

/// Increasing breakpoints that divide the line into cells, and the level that is reported for each cell.
///
/// Cell `i` is `[breakpoints[i - 1], breakpoints[i])`; the outer cells are unbounded. A sample equal to a breakpoint is in the
/// cell above it. In a *contiguous* quantizer cell `i` is level `i`. Otherwise several cells may have the same level ("label"), as in
/// a modulo quantizer or for the bit `|y| > c`.
///
/// ```
/// use fewbits_quantizers::Quantizer;
/// let folded = Quantizer::with_labels(vec![-1.4, 1.4], vec![1, 0, 1])?;
/// assert_eq!((folded.levels(), folded.encode(-3.0)?, folded.encode(0.2)?), (2, 1, 0));
/// # Ok::<(), fewbits_quantizers::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Quantizer {
    pub(crate) breakpoints: Vec<f64>,
    pub(crate) labels: Vec<usize>,
    #[serde(skip_serializing)]
    pub(crate) levels: usize,
}

/// The stored form of [`Quantizer`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    breakpoints: Vec<f64>,
    labels: Vec<usize>,
}

impl TryFrom<Stored> for Quantizer {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        Quantizer::with_labels(parts.breakpoints, parts.labels)
    }
}

/// Checks that breakpoints are finite and strictly increasing.
///
/// # Errors
/// If a number is not finite, or not above the one before.
pub fn check_increasing(breakpoints: &[f64]) -> Result<(), ArgumentError> {
    all_finite("breakpoints", breakpoints)?;
    match breakpoints.windows(2).position(|w| w[0] >= w[1]) {
        None => Ok(()),
        Some(at) => {
            let pair = format!("{}, {} at index {at}", breakpoints[at], breakpoints[at + 1]);
            Err(ArgumentError::new("breakpoints", pair, "strictly increasing numbers"))
        }
    }
}

/// Index of the cell that contains `y`: the number of breakpoints at or below `y`. Infinite samples are in the outer cells.
///
/// # Errors
/// If `y` is NaN.
#[inline]
pub fn cell_of(breakpoints: &[f64], y: f64) -> Result<usize, Error> {
    Ok(fewbits_node::cell_of(breakpoints, y).map_err(ArgumentError::from)?)
}

impl Quantizer {
    /// A contiguous quantizer: `breakpoints.len() + 1` levels.
    ///
    /// # Errors
    /// If the breakpoints are empty, not finite or not strictly increasing.
    pub fn new(breakpoints: Vec<f64>) -> Result<Self, Error> {
        let labels = (0..=breakpoints.len()).collect();
        Self::with_labels(breakpoints, labels)
    }

    /// A quantizer whose cell `i` is reported as level `labels[i]`.
    ///
    /// # Errors
    /// If the breakpoints are empty, not finite or not strictly increasing, `labels` is not one longer than they are, or the
    /// labels are not `0..levels`, each used, with at least two levels.
    pub fn with_labels(breakpoints: Vec<f64>, labels: Vec<usize>) -> Result<Self, Error> {
        if breakpoints.is_empty() {
            return refuse("breakpoints", "empty", "at least one breakpoint (two levels)");
        }
        check_increasing(&breakpoints)?;
        entries("labels", labels.len(), breakpoints.len() + 1)?;
        if let Some(label) = labels.iter().find(|label| **label >= labels.len()) {
            return refuse("labels", label, format!("numbers below {}, the number of cells", labels.len()));
        }
        // Labels below the number of cells: the search for an unused one then ends after as many steps.
        let levels = labels.iter().max().map_or(0, |m| m + 1);
        if levels < 2 {
            return refuse("labels", "a single level", "at least two levels");
        }
        if let Some(unused) = (0..levels).find(|l| !labels.contains(l)) {
            return refuse("labels", format!("without level {unused}"), format!("all of 0..{levels}"));
        }
        Ok(Self {
            breakpoints,
            labels,
            levels,
        })
    }

    /// The contiguous quantizer `{-outer, 0, outer}` of four levels.
    ///
    /// # Errors
    /// If `outer` is not a positive number.
    pub fn symmetric(outer: f64) -> Result<Self, Error> {
        positive("outer", outer)?;
        Self::new(vec![-outer, 0.0, outer])
    }

    /// Finite breakpoints, strictly increasing.
    pub fn breakpoints(&self) -> &[f64] {
        &self.breakpoints
    }

    /// Level of each cell.
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Number of different levels.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Number of cells, at least [`levels`](Self::levels).
    pub fn cells(&self) -> usize {
        self.labels.len()
    }

    /// Level of the cell that contains `y`; a breakpoint is in the cell above it. Does not allocate. Infinite samples are in
    /// the outer cells.
    ///
    /// # Errors
    /// If `y` is NaN.
    #[inline]
    pub fn encode(&self, y: f64) -> Result<usize, Error> {
        Ok(self.labels[cell_of(&self.breakpoints, y)?])
    }

    /// Cell `i`; `None` if there is no such cell.
    pub fn cell(&self, cell: usize) -> Option<Cell> {
        let (lower, upper) = self.edges(cell);
        (cell < self.cells()).then(|| Cell::new(lower, upper).ok()).flatten()
    }

    /// `p(symbol received | h(x) = m)` for a sample `m + n`, `n ~ N(0, noise_variance)`, whose level is sent over `channel`.
    ///
    /// A symbol that no level can cause has a factor of probability 0.
    ///
    /// # Errors
    /// If the channel has another number of inputs than levels, there is no such symbol, or the variance is not a positive number.
    pub fn factor(&self, symbol: usize, channel: &Channel, noise_variance: f64) -> Result<Scalar, Error> {
        if channel.inputs() != self.levels {
            return refuse("channel", format!("{} inputs", channel.inputs()), format!("{} inputs", self.levels));
        }
        if symbol >= channel.outputs() {
            return refuse("symbol", symbol, format!("a number below {}", channel.outputs()));
        }
        positive("noise_variance", noise_variance)?;
        let given = |level: &usize| channel.probability(symbol, *level);
        let given_cell: Vec<f64> = self.labels.iter().map(given).collect();
        // A partition refuses an observation that no cell can cause.
        if given_cell.iter().all(|p| *p == 0.0) {
            return Ok(Constant::new(0.0)?.into());
        }
        Ok(Levels::partition(&self.breakpoints, &given_cell, noise_variance)?.into())
    }

    /// Lower and upper edge of cell `i`, infinite at the ends.
    pub fn edges(&self, cell: usize) -> (f64, f64) {
        edges(&self.breakpoints, cell)
    }

    /// The quantizer with the same labels and other breakpoints.
    ///
    /// # Errors
    /// As [`Quantizer::with_labels`].
    pub fn with_breakpoints(&self, breakpoints: Vec<f64>) -> Result<Self, Error> {
        Self::with_labels(breakpoints, self.labels.clone())
    }

    /// The mirror image: the quantizer of `-y`, with the order of the levels reversed.
    pub fn mirrored(&self) -> Self {
        Self {
            breakpoints: self.breakpoints.iter().rev().map(|b| -b).collect(),
            labels: self.labels.iter().rev().map(|l| self.levels - 1 - l).collect(),
            levels: self.levels,
        }
    }

    /// The quantizer of `mean + scale * y`.
    ///
    /// # Errors
    /// If `mean` is not finite or `scale` is not a positive number.
    pub fn affine(&self, mean: f64, scale: f64) -> Result<Self, Error> {
        finite("mean", mean)?;
        positive("scale", scale)?;
        self.with_breakpoints(self.breakpoints.iter().map(|b| mean + scale * b).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn breakpoints_belong_to_the_cell_above() {
        let q = Quantizer::new(vec![-1.0, 0.0, 1.0]).unwrap();
        assert_eq!([-1.001, -1.0, -0.001, 0.0, 1.0].map(|y| q.encode(y).unwrap()), [0, 1, 1, 2, 3]);
        assert_eq!([f64::NEG_INFINITY, f64::INFINITY].map(|y| q.encode(y).unwrap()), [0, 3]);
        assert!(q.encode(f64::NAN).unwrap_err().to_string().contains("measurement"));
        for cell in 0..q.cells() {
            let held = q.cell(cell).unwrap();
            for y in [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0] {
                assert_eq!(held.contains(y), q.encode(y).unwrap() == cell);
            }
        }
        assert_eq!(q.cell(4), None);
        assert_eq!(q.edges(0), (f64::NEG_INFINITY, -1.0));
        assert_eq!(q.edges(3), (1.0, f64::INFINITY));
    }

    #[test]
    fn what_is_not_a_quantizer_is_refused_by_name() {
        for bad in [
            vec![],
            vec![0.0, 0.0],
            vec![1.0, 0.0],
            vec![f64::NAN],
            vec![f64::INFINITY],
        ] {
            assert!(Quantizer::new(bad).unwrap_err().to_string().contains("breakpoints"));
        }
        for labels in [vec![0, 0], vec![0, 2], vec![0], vec![0, 1, 2]] {
            assert!(
                Quantizer::with_labels(vec![0.0], labels)
                    .unwrap_err()
                    .to_string()
                    .contains("labels")
            );
        }
        assert!(Quantizer::symmetric(-1.0).is_err());
    }

    #[test]
    fn the_factor_of_a_symbol_is_its_probability() {
        use fewbits_core::factor::Factor;
        let q = Quantizer::with_labels(vec![-1.0, 0.3, 1.2], vec![0, 1, 2, 0]).unwrap();
        let channel = Channel::symbol_erasure(3, 0.2).unwrap();
        for m in [-3.0, 0.0, 0.7] {
            let mut levels = [0.0; 3];
            for (cell, level) in q.labels().iter().enumerate() {
                levels[*level] += q.cell(cell).unwrap().log_probability(m, 0.5).exp();
            }
            for symbol in 0..channel.outputs() {
                let p: f64 = (0..3)
                    .map(|level| levels[level] * channel.probability(symbol, level))
                    .sum();
                let factor = q.factor(symbol, &channel, 0.25).unwrap();
                assert!((factor.log_likelihood(&[m].into()).exp() - p).abs() < 1e-14);
            }
        }
        assert!(q.factor(4, &channel, 0.25).is_err());
        assert!(q.factor(0, &Channel::ideal(4).unwrap(), 0.25).is_err());
        assert!(q.factor(0, &channel, 0.0).is_err());
        let never = Channel::from_rows(&[vec![1.0, 1.0, 1.0], vec![0.0; 3]]).unwrap();
        assert_eq!(q.factor(1, &never, 0.25).unwrap().log_likelihood(&[0.0].into()), f64::NEG_INFINITY);
    }

    #[test]
    fn the_largest_label_is_refused_not_overflowed() {
        assert!(Quantizer::with_labels(vec![0.0], vec![0, usize::MAX]).is_err());
        let json = format!(r#"{{"breakpoints":[1.0],"labels":[0,{}]}}"#, usize::MAX);
        assert!(serde_json::from_str::<Quantizer>(&json).is_err());
    }

    #[test]
    fn quantizers_are_stored_and_checked_when_restored() {
        let q = Quantizer::with_labels(vec![-1.4, 1.4], vec![1, 0, 1]).unwrap();
        let json = serde_json::to_string(&q).unwrap();
        assert_eq!(serde_json::from_str::<Quantizer>(&json).unwrap(), q);
        assert!(serde_json::from_str::<Quantizer>(r#"{"breakpoints":[1.0,0.0],"labels":[0,1,2]}"#).is_err());
        assert!(serde_json::from_str::<Quantizer>(r#"{"breakpoints":[1.0],"labels":[0,2]}"#).is_err());
    }
}
