//! The models of the medium that a search still holds possible.

use crate::fit::Fit;
use crate::posterior::Posterior;
use crate::{Record, SourceSensor};
use fewbits_core::{Belief, Gaussian};
use fewbits_numerics::LogSum;
use nalgebra::Vector2;

/// Models this many nats below the best are not looked at again.
pub(super) const EXCLUDED: f64 = 30.0;

/// One model of the medium along a search.
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
}

impl Alternative {
    pub(super) fn log_posterior(&self) -> f64 {
        self.log_weight + self.log_evidence
    }
}

/// The first of the most probable.
pub(super) fn most_probable(alternatives: &[Alternative]) -> usize {
    (1..alternatives.len()).fold(0, |best, i| {
        if alternatives[i].probability > alternatives[best].probability {
            i
        } else {
            best
        }
    })
}

/// Mean and covariance of the position under all models.
pub(super) fn mixed(alternatives: &[Alternative]) -> Gaussian<2> {
    let parts = || {
        let held = alternatives.iter().filter(|a| a.probability > 0.0);
        held.filter_map(|a| Some((a.probability, &a.posterior.as_ref()?.cells)))
    };
    let mean: Vector2<f64> = parts().map(|(p, cells)| cells.mean() * p).sum();
    let covariance = parts().map(|(p, cells)| {
        let d = cells.mean() - mean;
        (cells.covariance() + d * d.transpose()) * p
    });
    Gaussian::from_trusted_parts(mean, covariance.sum())
}

/// How the samples fit under all models.
pub(super) fn mixed_fit(alternatives: &[Alternative], samples: usize) -> Fit {
    let held = alternatives.iter().filter(|a| a.probability > 0.0);
    let parts = held.filter_map(|a| Some(a.probability * a.posterior.as_ref()?.fit.chi_squared));
    Fit {
        chi_squared: parts.sum(),
        samples,
    }
}

/// Logarithm of the evidence under all models.
pub(super) fn log_evidence(alternatives: &[Alternative]) -> f64 {
    alternatives
        .iter()
        .map(Alternative::log_posterior)
        .collect::<LogSum>()
        .value()
}
