//! Groups of sensors with the same design.

use crate::error::{Error, refuse};
use crate::outcomes::counts::count;
use fewbits_quantizers::{Channel, Quantizer};
use serde::{Deserialize, Serialize};

/// Sensors of equal noise that share a quantizer design and a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredGroup")]
pub struct SensorGroup {
    pub(super) quantizer: Quantizer,
    pub(super) channel: Channel,
    pub(super) sensors: Vec<usize>,
}

/// The stored form of [`SensorGroup`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredGroup {
    quantizer: Quantizer,
    channel: Channel,
    sensors: Vec<usize>,
}

impl TryFrom<StoredGroup> for SensorGroup {
    type Error = Error;

    fn try_from(parts: StoredGroup) -> Result<Self, Error> {
        SensorGroup::new(parts.quantizer, parts.channel, parts.sensors)
    }
}

impl SensorGroup {
    /// The sensors with the given numbers, each with this quantizer, each behind its own copy of the channel.
    ///
    /// # Errors
    /// If the channel's number of inputs is not the quantizer's number of levels, or there is no sensor.
    pub fn new(quantizer: Quantizer, channel: Channel, sensors: Vec<usize>) -> Result<Self, Error> {
        if channel.inputs() != quantizer.levels() {
            let levels = quantizer.levels();
            return refuse("channel", format!("{} inputs", channel.inputs()), format!("one input a level, {levels}"));
        }
        if sensors.is_empty() {
            return refuse("sensors", "empty", "at least one sensor a group");
        }
        Ok(Self {
            quantizer,
            channel,
            sensors,
        })
    }

    /// The quantizer.
    pub fn quantizer(&self) -> &Quantizer {
        &self.quantizer
    }

    /// The channel behind each sensor.
    pub fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Indices of the sensors in the model.
    pub fn sensors(&self) -> &[usize] {
        &self.sensors
    }

    /// `P(received = t | sample in cell i)`.
    pub(crate) fn cell_transition(&self, t: usize, cell: usize) -> f64 {
        self.channel.probability(t, self.quantizer.labels()[cell])
    }

    /// Number of different joint reports of the group, if only the counts of symbols matter.
    pub(crate) fn outcomes(&self) -> u64 {
        count(self.sensors.len(), self.channel.outputs())
    }
}
