//! Particles as they are stored.

use crate::Error;
use fewbits_numerics::error::refuse;
use serde::{Deserialize, Serialize};

/// Columns, weights with their logarithms (of which a weight of zero has none: JSON has no infinity) and auxiliary rows.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename = "Particles", deny_unknown_fields)]
pub(crate) struct StoredParticles {
    #[serde(with = "fewbits_numerics::stored")]
    columns: Vec<Vec<f64>>,
    #[serde(with = "fewbits_numerics::stored")]
    weights: Vec<f64>,
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

/// Columns, weights, log weights, effective sample size, auxiliary rows.
type Parts = (Vec<Vec<f64>>, Vec<f64>, Vec<f64>, Option<f64>, Vec<f64>);

impl StoredParticles {
    /// Equal weights need no logarithms.
    pub(crate) fn new(
        columns: Vec<Vec<f64>>,
        weights: Vec<f64>,
        log_weights: &[f64],
        effective_sample_size: f64,
        auxiliary: Vec<f64>,
    ) -> Self {
        let equal = log_weights.windows(2).all(|pair| pair[0] == pair[1]);
        let stored = |w: &f64| w.is_finite().then_some(*w);
        Self {
            columns,
            weights,
            log_weights: if equal {
                Vec::new()
            } else {
                log_weights.iter().map(stored).collect()
            },
            effective_sample_size: (!equal).then_some(effective_sample_size),
            auxiliary,
        }
    }

    /// The parts, if weights are weights and logarithms theirs.
    pub(crate) fn parts(self) -> Result<Parts, Error> {
        fewbits_numerics::error::probabilities("weights", &self.weights)?;
        let log_weights: Vec<f64> = if self.log_weights.is_empty() {
            self.weights.iter().map(|w| w.ln()).collect()
        } else {
            self.log_weights
                .iter()
                .map(|w| w.unwrap_or(f64::NEG_INFINITY))
                .collect()
        };
        let agree = |(log, w): (&f64, &f64)| (log.exp() - w).abs() <= 1e-9;
        if log_weights.len() != self.weights.len() || !log_weights.iter().zip(&self.weights).all(agree) {
            let text = format!("{} numbers", log_weights.len());
            return refuse("log_weights", text, "the logarithms of the weights");
        }
        let effective = 1.0 / self.weights.iter().map(|w| w * w).sum::<f64>();
        if let Some(bad) = self
            .effective_sample_size
            .filter(|n| (n / effective - 1.0).abs() > 1e-9 || n.is_nan())
        {
            return refuse("effective_sample_size", bad, format!("{effective}"));
        }
        Ok((self.columns, self.weights, log_weights, self.effective_sample_size, self.auxiliary))
    }
}
