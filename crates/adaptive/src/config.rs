//! Configuration that sensor and receiver must share.

use fewbits_node::adaptive as node;
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// The configuration of a sensor and its receiver: the error bound, and how losses are handled. Deserialization (`serde`) checks it;
/// [`fewbits_node::adaptive::Config`] is the same for a microcontroller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Config(pub(crate) node::Config);

/// The stored form of [`Config`].
#[derive(Serialize, Deserialize)]
#[serde(rename = "Config", deny_unknown_fields)]
struct Stored {
    delta: f64,
    #[serde(default)]
    period: Option<f64>,
    sequence_bits: u32,
    refresh_every: Option<u64>,
    #[serde(default)]
    exact: bool,
}

impl From<Config> for Stored {
    fn from(config: Config) -> Self {
        Self {
            delta: config.delta(),
            period: config.period(),
            sequence_bits: config.sequence_bits(),
            refresh_every: config.refresh_every(),
            exact: config.resolution().is_some(),
        }
    }
}

impl TryFrom<Stored> for Config {
    type Error = ArgumentError;

    fn try_from(stored: Stored) -> Result<Self, ArgumentError> {
        let mut config = Config::new(stored.delta)?;
        if stored.exact {
            config = config.made_exact();
        }
        if let Some(period) = stored.period {
            config = config.circular(period)?;
        }
        if stored.sequence_bits > 0 {
            config = config.resilient(stored.sequence_bits, stored.refresh_every)?;
        }
        Ok(config)
    }
}

impl Config {
    /// Every reconstruction is within `delta` (measurement units) of its sample, on a link that loses nothing.
    ///
    /// # Errors
    /// If `delta` is not above 0 or `2 delta` not finite.
    pub fn new(delta: f64) -> Result<Self, ArgumentError> {
        Ok(Self(node::Config::new(delta)?))
    }

    /// For an instrument whose samples are decimal numbers that are multiples of `resolution` apart: such samples are reconstructed
    /// exactly, to the last bit. Other samples are reconstructed within `resolution / 2`; samples half-way between need more bits than with
    /// [`new`](Self::new). On a circle this is the same as `new(resolution / 2)`.
    ///
    /// # Errors
    /// If `resolution` is not positive and finite, or half of it 0.
    pub fn exact(resolution: f64) -> Result<Self, ArgumentError> {
        Ok(Self(node::Config::exact(resolution)?))
    }

    /// The same configuration with another error bound.
    ///
    /// # Errors
    /// As [`new`](Self::new) and [`circular`](Self::circular).
    pub fn with_delta(self, delta: f64) -> Result<Self, ArgumentError> {
        Ok(Self(self.0.with_delta(delta)?))
    }

    /// The signal is periodic: samples are taken modulo `period` (360 for degrees), reconstructions lie in `[0, period)`,
    /// and `delta` bounds the error around the circle.
    ///
    /// # Errors
    /// If `period` is not positive and finite, or above `2^40 delta`.
    pub fn circular(self, period: f64) -> Result<Self, ArgumentError> {
        Ok(Self(self.0.circular(period)?))
    }

    /// For links that lose packets. Every packet has a counter of `sequence_bits` bits, and a flag that marks a refresh. The receiver
    /// notices a loss by the counter, unless a multiple of `2^sequence_bits` packets was lost in a row. Every `refresh_every` slots, and
    /// whenever it is asked to, the sensor sends a refresh, from which a receiver can start.
    ///
    /// # Errors
    /// If `sequence_bits` is not in `1..=16` or `refresh_every` is 0.
    pub fn resilient(self, sequence_bits: u32, refresh_every: Option<u64>) -> Result<Self, ArgumentError> {
        Ok(Self(self.0.resilient(sequence_bits, refresh_every)?))
    }

    /// Largest error of a reconstruction, in measurement units.
    pub fn delta(&self) -> f64 {
        self.0.delta()
    }

    pub(crate) fn made_exact(self) -> Self {
        Self(self.0.made_exact())
    }

    /// Distance of which the differences of samples are multiples, for [`exact`](Self::exact).
    pub fn resolution(&self) -> Option<f64> {
        self.0.resolution()
    }

    /// The period of a circular signal.
    pub fn period(&self) -> Option<f64> {
        self.0.period()
    }

    /// Slots from one scheduled refresh to the next.
    pub(crate) fn refresh_every(&self) -> Option<u64> {
        self.0.refresh_every()
    }

    /// Bits of the counter in a packet; 0 if there is none.
    pub fn sequence_bits(&self) -> u32 {
        self.0.sequence_bits()
    }

    /// Whether packets have a counter and a refresh flag.
    pub(crate) fn is_resilient(&self) -> bool {
        self.0.is_resilient()
    }
}
