//! The serialised form of particles.

use serde::{Deserialize, Serialize};

/// Columns, log weights (of a weight of zero `-inf`, as text in JSON; `null` is read too), and auxiliary rows.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename = "Particles", deny_unknown_fields)]
pub(super) struct StoredParticles {
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
    /// Empty if all weights are equal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) log_weights: Vec<Option<f64>>,
    /// Stored as it was computed, so that a resumed filter gives the same bits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) effective_sample_size: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) auxiliary: Vec<f64>,
}
