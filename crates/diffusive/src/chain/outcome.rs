//! The outcome of a search: its steps, and the reason for its end.

use crate::fit::Fit;
use crate::posterior::Posterior;
use crate::{Error, Record};
use fewbits_core::Gaussian;

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// The determinant fell below the threshold.
    Converged,
    /// No unvisited node can be reached.
    Exhausted,
    /// The most nodes were used.
    NodeLimit,
    /// A node's samples and the belief that it received exclude each other: a mode was lost on the way, or the model is wrong.
    BeliefMiss,
    /// The samples are not what the model says ([`Fit`]): no source at the place and with a rate that are possible causes them in this
    /// medium. Whatever the belief says, do not trust it.
    Misfit,
    /// The encoded belief does not decode to a belief: the numbers of the wire format are too coarse.
    Undecodable,
    /// The posterior leans on the border of the search box: the source is probably outside.
    OutsideField,
    /// The posterior is too thin for the cells allowed.
    Unresolved,
}

/// One node's part in a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Which node sampled.
    pub node: usize,
    /// Hops from the node before.
    pub hops: usize,
    /// Mean and covariance of what travels on (of the posterior, for raw records).
    pub estimate: Gaussian<2>,
    /// `log10` of the determinant of that covariance, m^4.
    pub log10_determinant: f64,
    /// Bits that arrived with the belief from the node before, over all hops.
    pub bits: usize,
    /// Cells that were evaluated.
    pub evaluations: usize,
    /// Logarithm of the integral of belief times likelihood.
    pub log_evidence: f64,
    /// How the samples fit so far. Raw records: all samples under this posterior. Other forms: of every node its own samples under
    /// its own posterior, summed; the sum travels with the belief.
    pub fit: Fit,
}

/// Outcome of a search.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why it ended.
    pub status: Status,
    /// Every node that sampled, in order.
    pub steps: Vec<Step>,
    /// The last posterior, before projection. With several models that of the most probable one.
    pub posterior: Option<Posterior>,
    /// The records that were used. With several models those of the most probable one.
    pub records: Vec<Record>,
    /// Probabilities of the models, in their order.
    pub models: Vec<f64>,
}

impl Outcome {
    /// The last estimate.
    pub fn estimate(&self) -> Option<&Gaussian<2>> {
        self.steps.last().map(|step| &step.estimate)
    }

    /// How the samples fit at the last node.
    pub fn fit(&self) -> Option<Fit> {
        self.steps.last().map(|step| step.fit)
    }

    /// All bits that travelled.
    pub fn bits(&self) -> usize {
        self.steps.iter().map(|step| step.bits).sum()
    }
}

/// Failures of a belief that end a search; others are errors.
pub(super) fn failure(error: &Error) -> Option<Status> {
    match error {
        Error::Impossible => Some(Status::BeliefMiss),
        Error::Unresolved { .. } => Some(Status::Unresolved),
        Error::Argument(_) => Some(Status::BeliefMiss),
        _ => None,
    }
}
