//! The outcome of a search: its steps, and the reason for its end.

use super::state::SearchState;
use crate::fit::Fit;
use crate::posterior::Posterior;
use crate::{Error, Record};
use fewbits_core::Gaussian;

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// The determinant of the position's covariance fell below the threshold.
    Converged,
    /// No unvisited node can be reached.
    Exhausted,
    /// The largest number of nodes was reached.
    NodeLimit,
    /// A node's samples have probability zero under the belief that it received. A mode was lost in an earlier message, or the model is
    /// wrong.
    BeliefMiss,
    /// The samples contradict the model ([`Fit`]): no possible place and rate of a source explains them in this
    /// medium. The belief must then not be used, however sharp it is.
    Misfit,
    /// The encoded belief does not decode to a belief: the number format is too coarse.
    Undecodable,
    /// The posterior has much mass at the border of the search box: the source is probably outside.
    OutsideField,
    /// The posterior is too thin for the allowed number of cells.
    Unresolved,
}

/// What follows a node's step.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Action {
    /// The state is sent to this node, which samples next.
    Ask {
        /// Its index.
        node: usize,
        /// Hops to it.
        hops: usize,
    },
    /// The search ends.
    End {
        /// Why.
        status: Status,
        /// The last posterior, before projection; `None` if the last update failed.
        posterior: Option<Posterior>,
        /// The error behind [`Status::Undecodable`] or a posterior that cannot be projected.
        cause: Option<Error>,
    },
}

/// Result of a node's step ([`Search::step`](super::Search::step)).
#[derive(Debug, Clone)]
pub struct Next {
    /// The state after the step.
    pub state: SearchState,
    /// What was estimated, without the hops and bits of the message before (zero here); `None` if the update failed.
    pub step: Option<Step>,
    /// Bits of the records or the belief of the message to the next node, over one hop; zero if the update failed.
    pub bits: usize,
    /// What follows.
    pub action: Action,
}

impl Next {
    /// The end of a search at a node without an estimate.
    pub(super) fn end(state: SearchState, posterior: Option<Posterior>, status: Status) -> Self {
        let action = Action::End {
            status,
            posterior,
            cause: None,
        };
        Self {
            state,
            step: None,
            bits: 0,
            action,
        }
    }

    /// The same end with the error behind it.
    pub(super) fn because(mut self, error: Error) -> Self {
        if let Action::End { cause, .. } = &mut self.action {
            *cause = Some(error);
        }
        self
    }
}

/// One node's part in a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Index of the node that sampled.
    pub node: usize,
    /// Hops from the node before to this one.
    pub hops: usize,
    /// Mean and covariance of the belief that is sent on (of the posterior, for raw records), m and m^2.
    pub estimate: Gaussian<2>,
    /// `log10` of the determinant of that covariance, m^4.
    pub log10_determinant: f64,
    /// Bits of the records or the belief in the message from the node before, over all hops. The route, which
    /// [`Search::encode`](super::Search::encode) adds to a belief, is not counted.
    pub bits: usize,
    /// Number of cells that were evaluated.
    pub evaluations: usize,
    /// Logarithm of the integral of belief times likelihood.
    pub log_evidence: f64,
    /// How the samples fit so far. Raw records: all samples under this posterior. Other forms: the sum over all nodes so far of the fit
    /// of each node's samples under its own posterior. The sum is sent with the belief.
    pub fit: Fit,
}

/// Outcome of a search.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why the search ended.
    pub status: Status,
    /// The error behind [`Status::Undecodable`] or a posterior that cannot be projected.
    pub cause: Option<Error>,
    /// Every node that sampled, in order.
    pub steps: Vec<Step>,
    /// The last posterior, before projection. With several models it is that of the most probable one.
    pub posterior: Option<Posterior>,
    /// The records that were used. With several models they are those of the most probable one.
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

    /// Total bits of all messages.
    pub fn bits(&self) -> usize {
        self.steps.iter().map(|step| step.bits).sum()
    }
}

/// The status for an error of a belief that ends the search; `None` for other errors.
pub(super) fn failure(error: &Error) -> Option<Status> {
    match error {
        Error::Impossible | Error::Argument(_) => Some(Status::BeliefMiss),
        Error::Unresolved { .. } => Some(Status::Unresolved),
        _ => None,
    }
}
