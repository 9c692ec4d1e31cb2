//! Groups of sensors with the same design.

use crate::outcomes::counts::count;
use fewbits_quantizers::{Channel, Quantizer};
use serde::{Deserialize, Serialize};

/// Sensors of equal noise that share a quantizer design and a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorGroup {
    /// The quantizer of each sensor.
    pub quantizer: Quantizer,
    /// The channel behind each sensor, of which each has its own copy.
    pub channel: Channel,
    /// Indices of the sensors in the model.
    pub sensors: Vec<usize>,
}

impl SensorGroup {
    /// `P(received = t | sample in cell i)`.
    pub(crate) fn cell_transition(&self, t: usize, cell: usize) -> f64 {
        self.channel.probability(t, self.quantizer.labels()[cell])
    }

    /// Number of different joint reports of the group, if only the counts of symbols matter.
    pub(crate) fn outcomes(&self) -> u64 {
        count(self.sensors.len(), self.channel.outputs())
    }
}
