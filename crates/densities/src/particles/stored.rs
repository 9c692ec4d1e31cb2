//! Particles as they are stored.

use serde::{Deserialize, Serialize};

/// Columns, weights with their logarithms (of which a weight of zero has none: JSON has no infinity) and auxiliary rows.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename = "Particles", deny_unknown_fields)]
pub(super) struct StoredParticles {
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) columns: Vec<Vec<f64>>,
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) weights: Vec<f64>,
    /// Equal weights need no logarithms.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) log_weights: Vec<Option<f64>>,
    /// As it was summed, so that a filter resumes to the last bit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) effective_sample_size: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) auxiliary: Vec<f64>,
}
