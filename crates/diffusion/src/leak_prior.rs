//! What is known of a leak before the first reading, and what a reading says.

use crate::Error;
use fewbits_numerics::error::{all_finite, at_least_one, finite, positive, refuse, within};

/// What is known of a leak before the first reading. Every cell is as likely as its volume.
#[derive(Debug, Clone, PartialEq)]
pub struct LeakPrior {
    /// First and last time at which it may have begun, s. Every time between is equally likely. Of a steady field it has no effect.
    pub start: [f64; 2],
    /// Smallest and largest rate, kg/s. The logarithm is uniform.
    pub rate: [f64; 2],
    /// Relative error of what the model says a sensor measures, one standard deviation: of the diffusivity, the wind, the sensor's gain. It lasts:
    /// all readings of a sensor share it.
    pub model_error: f64,
    /// Share of readings that say nothing of the concentration.
    pub faults: f64,
}

/// What a sensor said of the concentration that it measured with Gaussian noise.
#[derive(Debug, Clone, PartialEq)]
pub enum Reading {
    /// The value, kg/m^3.
    Value(f64),
    /// The measurement is in cell `word` of those between increasing `edges`: below the first edge it is 0.
    Word {
        /// Edges, kg/m^3.
        edges: Vec<f64>,
        /// Number of the cell.
        word: usize,
    },
}

/// Smallest and largest number of starts of a belief, and the number of pairs of a cell and a start above which there are fewer: words of a sensor share
/// the error of the start, which a belief takes for one of each word.
const MIN_STARTS: usize = 12;
const MAX_STARTS: usize = 48;
const MAX_PAIRS: usize = 1 << 15;

impl LeakPrior {
    /// The middles of equal parts of the times at which the leak may have begun; one of a steady field.
    pub(crate) fn starts(&self, cells: usize, is_steady: bool) -> Vec<f64> {
        let [first, last] = self.start;
        let count = if last > first && !is_steady {
            (MAX_PAIRS / cells.max(1)).clamp(MIN_STARTS, MAX_STARTS)
        } else {
            1
        };
        let width = (last - first) / count as f64;
        (0..count).map(|i| first + (i as f64 + 0.5) * width).collect()
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        all_finite("start", &self.start)?;
        if self.start[0] > self.start[1] {
            return refuse("start", format!("{:?}", self.start), "the first time before the last");
        }
        positive("rate", self.rate[0])?;
        if !(self.rate[1] > self.rate[0] && self.rate[1].is_finite()) {
            return refuse("rate", format!("{:?}", self.rate), "a smaller and a larger rate");
        }
        within("model_error", self.model_error, 0.0, 1.0)?;
        within("faults", self.faults, 0.0, 0.999)?;
        Ok(())
    }
}

impl Reading {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (edges, word) = match self {
            Self::Value(value) => return Ok(finite("value", *value).map(|_| ())?),
            Self::Word { edges, word } => (edges, word),
        };
        all_finite("edges", edges)?;
        at_least_one("edges", edges.len())?;
        if let Some(pair) = edges.windows(2).find(|pair| pair[0] >= pair[1]) {
            return refuse("edges", format!("{} before {}", pair[0], pair[1]), "increasing edges");
        }
        if *word > edges.len() {
            return refuse("word", word, format!("at most {}", edges.len()));
        }
        Ok(())
    }
}
