//! Particles as they are stored.

use super::Particles;
use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{probabilities, refuse};
use serde::{Deserialize, Serialize};

/// Columns, weights with their logarithms (of which a weight of zero has none: JSON has no infinity) and auxiliary rows.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename = "Particles", deny_unknown_fields)]
pub(crate) struct StoredParticles {
    #[serde(with = "fewbits_numerics::stored")]
    columns: Vec<Vec<f64>>,
    #[serde(with = "fewbits_numerics::stored")]
    weights: Vec<f64>,
    /// Equal weights need no logarithms.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(with = "fewbits_numerics::stored")]
    log_weights: Vec<Option<f64>>,
    /// As it was summed, so that a filter resumes to the last bit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[serde(with = "fewbits_numerics::stored")]
    effective_sample_size: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(with = "fewbits_numerics::stored")]
    auxiliary: Vec<f64>,
}

impl<const D: usize> From<Particles<D>> for StoredParticles {
    fn from(belief: Particles<D>) -> Self {
        let equal = belief.log_weights.windows(2).all(|pair| pair[0] == pair[1]);
        let stored = |w: &f64| w.is_finite().then_some(*w);
        Self {
            columns: belief.columns.into(),
            weights: belief.weights,
            log_weights: if equal {
                Vec::new()
            } else {
                belief.log_weights.iter().map(stored).collect()
            },
            effective_sample_size: (!equal).then_some(belief.effective_sample_size),
            auxiliary: belief.auxiliary,
        }
    }
}

impl<const D: usize> TryFrom<StoredParticles> for Particles<D> {
    type Error = Error;

    fn try_from(stored: StoredParticles) -> Result<Self, Error> {
        let weights = stored.weights;
        probabilities("weights", &weights)?;
        let log_weights: Vec<f64> = if stored.log_weights.is_empty() {
            weights.iter().map(|w| w.ln()).collect()
        } else {
            let logs = stored.log_weights.iter();
            logs.map(|log| log.unwrap_or(f64::NEG_INFINITY)).collect()
        };
        let agree = |(log, w): (&f64, &f64)| (log.exp() - w).abs() <= 1e-9;
        if log_weights.len() != weights.len() || !log_weights.iter().zip(&weights).all(agree) {
            let text = format!("{} numbers", log_weights.len());
            return refuse("log_weights", text, "the logarithms of the weights");
        }
        let effective = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let given = stored.effective_sample_size;
        if let Some(bad) = given.filter(|n| (n / effective - 1.0).abs() > 1e-9 || n.is_nan()) {
            return refuse("effective_sample_size", bad, format!("{effective}"));
        }
        let columns = stored.columns.try_into().map_err(|columns: Vec<Vec<f64>>| {
            ArgumentError::new("columns", format!("{} columns", columns.len()), format!("{D} columns"))
        })?;
        let mut belief = Self::new(columns, &log_weights)?.with_auxiliary(stored.auxiliary)?;
        // As it was stored, to the last bit.
        if weights.windows(2).all(|pair| pair[0] == pair[1]) {
            belief.equalise(weights.len());
        } else {
            belief.effective_sample_size = given.unwrap_or(belief.effective_sample_size);
            (belief.weights, belief.log_weights) = (weights, log_weights);
        }
        Ok(belief)
    }
}
