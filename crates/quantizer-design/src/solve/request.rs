//! A request: the problem and the options of a design.

use super::control::Progress;
use super::participant::WordedCells;
use crate::criterion::{AllowedCells, Criterion};
use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use fewbits_core::Link;
use fewbits_numerics::error::entries;
use fewbits_quantizers::quantizer::check_increasing;
use std::time::Duration;

/// Longest word of a sensor. More bits need no joint design: a Lloyd-Max quantizer loses next to nothing.
pub const MAX_BITS: u32 = 6;
/// Most bits that are shared out.
pub(super) const MAX_TOTAL: u32 = 40;

/// How many bits the sensors may send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BitBudget {
    /// Every sensor this many.
    Each(u32),
    /// Every sensor its own number, zero for a sensor that is not used.
    PerSensor(Vec<u32>),
    /// All sensors together this many; who sends how many is part of the design.
    Total(u32),
}

/// A design to be made: who measures what, how many bits each may send, over which links, and to what end.
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
    /// Breakpoints and words of every sensor to start from.
    pub(super) start: Option<Vec<WordedCells>>,
    pub(super) time_limit: Option<Duration>,
    pub(super) progress: Option<&'a mut dyn FnMut(Progress)>,
}

impl<'a> Request<'a> {
    /// Quantizers, words and decoder for the estimate of least mean squared error. The prior may be any, discrete ones included:
    /// their values are taken as numbers to be estimated, not as hypotheses.
    pub fn estimation(model: ObservationModel, bits: BitBudget, link: Link) -> Self {
        Self {
            links: vec![link; model.sensors()],
            model,
            bits,
            criterion: Criterion::MeanSquaredError,
            cells: AllowedCells::Intervals,
            starts: 60,
            start: None,
            time_limit: None,
            progress: None,
        }
    }

    /// Quantizers, words and decoder for the decision between the values of a discrete prior with the least error probability.
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

    /// Asks for the most information between the unknown and the symbols instead.
    #[must_use]
    pub fn by_information(mut self) -> Self {
        self.criterion = Criterion::MutualInformation;
        self
    }

    /// A link for each sensor.
    ///
    /// # Errors
    /// If their number is not that of the sensors.
    pub fn with_links(mut self, links: Vec<Link>) -> Result<Self, Error> {
        entries("links", links.len(), self.model.sensors())?;
        self.links = links;
        Ok(self)
    }

    /// Whether a word may stand for several intervals (default: one interval per word). Folded cells pay where noise is shared or
    /// small; they are harder to explain.
    #[must_use]
    pub fn with_cells(mut self, cells: AllowedCells) -> Self {
        self.cells = cells;
        self
    }

    /// Starts of the search over all sensors (default 60), besides those with one sensor's cells folded where that is allowed; fewer
    /// where a start is expensive. The result depends on nothing else unless a time limit is met.
    #[must_use]
    pub fn with_starts(mut self, starts: usize) -> Self {
        self.starts = starts.max(1);
        self
    }

    /// Tries a design of the caller's as a start, too: breakpoints and the word of each cell, for every sensor of the model.
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

    /// Ends the search after this time with the best design so far. Its value comes on top: a fraction of a second, or some seconds
    /// for a million joint symbols with correlated unequal noise.
    #[must_use]
    pub fn with_time_limit(mut self, limit: Duration) -> Self {
        self.time_limit = Some(limit);
        self
    }

    /// Calls `progress` between the parts of the design.
    #[must_use]
    pub fn with_progress(mut self, progress: &'a mut dyn FnMut(Progress)) -> Self {
        self.progress = Some(progress);
        self
    }
}
