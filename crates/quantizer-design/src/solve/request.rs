//! A request: the design problem and its options.

use super::control::Watch;
use super::participant::WordedCells;
use crate::criterion::{AllowedCells, Criterion};
use crate::deadline::{Clock, system_clock};
use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use fewbits_core::Link;
use fewbits_numerics::error::entries;
use fewbits_quantizers::quantizer::check_increasing;
use std::time::Duration;

/// Largest number of bits of a word. For longer words a Lloyd-Max quantizer is nearly optimal.
pub const MAX_BITS: u32 = 6;
/// Largest total number of bits that is distributed over the sensors.
pub(super) const MAX_TOTAL: u32 = 40;

/// The numbers of bits that the sensors may send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BitBudget {
    /// The same number for every sensor.
    Each(u32),
    /// A number for each sensor, in order; zero for a sensor that is not used.
    PerSensor(Vec<u32>),
    /// The total over all sensors. The design chooses the number of each sensor.
    Total(u32),
}

/// A design problem: the model, the bits, the links and the criterion.
///
/// ```
/// use fewbits_core::Link;
/// use fewbits_quantizer_design::solve::{BitBudget, Request};
/// use fewbits_quantizer_design::{Noise, Prior, ObservationModel};
///
/// let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.5], 0.5)?;
/// let model = ObservationModel::new(Prior::normal(20.0, 4.0)?, noise)?;
/// let solutions = Request::estimation(model, BitBudget::Each(2), Link::flipping(0.02)?).run()?;
/// let best = solutions.best();
/// println!("{}", best.table());
/// let estimate = best.decoder(100)?.decode_symbols(&best.encode(&[21.3, 22.0])?)?;
/// assert!((estimate.mean - 21.0).abs() < 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Request<'a> {
    pub(super) model: ObservationModel,
    pub(super) bits: BitBudget,
    pub(super) links: Vec<Link>,
    pub(super) criterion: Criterion,
    pub(super) cells: AllowedCells,
    pub(super) starts: usize,
    /// Breakpoints and words of every sensor, as an additional start.
    pub(super) start: Option<Vec<WordedCells>>,
    pub(super) clock: Clock,
    pub(super) time_limit: Option<Duration>,
    pub(super) progress: Option<&'a mut Watch<'a>>,
}

impl<'a> Request<'a> {
    /// Quantizers, words and decoder for the estimate of least mean squared error. The prior may also be discrete;
    /// its values are then numbers to be estimated, not hypotheses.
    pub fn estimation(model: ObservationModel, bits: BitBudget, link: Link) -> Self {
        Self {
            links: vec![link; model.sensors()],
            model,
            bits,
            criterion: Criterion::MeanSquaredError,
            cells: AllowedCells::Intervals,
            starts: 60,
            start: None,
            clock: system_clock,
            time_limit: None,
            progress: None,
        }
    }

    /// Quantizers, words and decoder for deciding between the values of a discrete prior with the smallest error probability.
    ///
    /// # Errors
    /// If the prior is not discrete.
    pub fn detection(model: ObservationModel, bits: BitBudget, link: Link) -> Result<Self, Error> {
        if !model.prior().is_discrete() {
            return refuse("prior", "a continuous prior", "a discrete prior: the hypotheses");
        }
        Ok(Self {
            criterion: Criterion::BayesError,
            ..Self::estimation(model, bits, link)
        })
    }

    /// Uses the mutual information between the unknown and the symbols as criterion.
    #[must_use]
    pub fn by_information(mut self) -> Self {
        self.criterion = Criterion::MutualInformation;
        self
    }

    /// Sets a link for each sensor.
    ///
    /// # Errors
    /// If their number is not that of the sensors.
    pub fn with_links(mut self, links: Vec<Link>) -> Result<Self, Error> {
        entries("links", links.len(), self.model.sensors())?;
        self.links = links;
        Ok(self)
    }

    /// Sets whether a word may stand for several intervals (default: one interval per word). Folded cells help if noise is shared or
    /// small; they are harder to interpret.
    #[must_use]
    pub fn with_cells(mut self, cells: AllowedCells) -> Self {
        self.cells = cells;
        self
    }

    /// Number of starts of the search over all sensors (default 60). Starts with one sensor's cells folded come in addition if folded cells
    /// are allowed. Fewer are used if a start is expensive. The result is reproducible unless a time limit is reached.
    #[must_use]
    pub fn with_starts(mut self, starts: usize) -> Self {
        self.starts = starts.max(1);
        self
    }

    /// Adds a given design as a start: breakpoints, and the word of each cell, for every sensor of the model.
    ///
    /// # Errors
    /// If there is not one entry per sensor, breakpoints do not increase, or there is not one word per cell.
    pub fn with_start(mut self, cells: Vec<(Vec<f64>, Vec<usize>)>) -> Result<Self, Error> {
        entries("cells", cells.len(), self.model.sensors())?;
        for (breakpoints, words) in &cells {
            check_increasing(breakpoints)?;
            entries("cells", words.len(), breakpoints.len() + 1)?;
        }
        let cells = cells
            .into_iter()
            .map(|(breakpoints, words)| WordedCells { breakpoints, words });
        self.start = Some(cells.collect());
        Ok(self)
    }

    /// Ends the search after this time and returns the best design so far. Computing its value takes additional time: a fraction of a
    /// second, or some seconds for a million joint symbols with correlated unequal noise.
    #[must_use]
    pub fn with_time_limit(mut self, limit: Duration) -> Self {
        self.time_limit = Some(limit);
        self
    }

    /// Reads times from this clock (default: [`system_clock`]). Needed for a time limit and for [`Progress::elapsed`](super::Progress::elapsed) where the standard
    /// library has no clock, as in a browser.
    #[must_use]
    pub fn with_clock(mut self, clock: Clock) -> Self {
        self.clock = clock;
        self
    }

    /// Calls `progress` between steps of the search. If it breaks, the search ends with the best design so far, which is marked as cut
    /// short.
    #[must_use]
    pub fn with_progress(mut self, progress: &'a mut Watch<'a>) -> Self {
        self.progress = Some(progress);
        self
    }
}
