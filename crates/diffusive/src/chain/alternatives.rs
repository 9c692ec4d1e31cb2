//! The models of the medium that a search still considers possible.

use crate::fit::Fit;
use crate::posterior::Posterior;
use crate::{Record, SourceSensor};
use fewbits_core::{Belief, Gaussian};
use fewbits_densities::moment_matched;
use fewbits_numerics::LogSum;

/// A model whose log probability is this many nats below the best is excluded.
pub(super) const EXCLUDED: f64 = 30.0;

/// One model of the medium along a search.
#[derive(Debug, Clone)]
pub(super) struct Alternative {
    pub(super) sensor: SourceSensor,
    /// Logarithm of the prior probability; `-inf` once the model is excluded.
    pub(super) log_weight: f64,
    pub(super) log_evidence: f64,
    pub(super) probability: f64,
    pub(super) records: Vec<Record>,
    pub(super) posterior: Option<Posterior>,
}

impl Alternative {
    pub(super) fn new((sensor, prior): (&SourceSensor, f64)) -> Self {
        Self {
            sensor: sensor.clone(),
            log_weight: prior.ln(),
            log_evidence: 0.0,
            probability: prior,
            records: Vec::new(),
            posterior: None,
        }
    }

    pub(super) fn log_posterior(&self) -> f64 {
        self.log_weight + self.log_evidence
    }
}

/// Index of the most probable model, the lowest in a tie.
pub(super) fn most_probable(alternatives: &[Alternative]) -> usize {
    (1..alternatives.len()).fold(0, |best, i| {
        if alternatives[i].probability > alternatives[best].probability {
            i
        } else {
            best
        }
    })
}

/// Mean and covariance of the position, averaged over all models by their probabilities.
pub(super) fn mixed(alternatives: &[Alternative]) -> Gaussian<2> {
    let held = alternatives.iter().filter(|a| a.probability > 0.0);
    moment_matched(held.filter_map(|a| {
        let cells = &a.posterior.as_ref()?.cells;
        Some((a.probability, cells.mean(), cells.covariance()))
    }))
}

/// Fit of the samples, averaged over all models by their probabilities.
pub(super) fn mixed_fit(alternatives: &[Alternative], samples: usize) -> Fit {
    let held = alternatives.iter().filter(|a| a.probability > 0.0);
    let parts = held.filter_map(|a| Some(a.probability * a.posterior.as_ref()?.fit.chi_squared));
    Fit {
        chi_squared: parts.sum(),
        samples,
    }
}

/// Logarithm of the evidence, summed over all models.
pub(super) fn log_evidence(alternatives: &[Alternative]) -> f64 {
    alternatives
        .iter()
        .map(Alternative::log_posterior)
        .collect::<LogSum>()
        .value()
}
