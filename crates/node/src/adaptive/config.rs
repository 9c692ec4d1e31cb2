//! Configuration that sensor and receiver must share.

use crate::error::{Error, positive};

/// The configuration of a sensor and its receiver: the error bound, and how losses are handled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    delta: f64,
    period: Option<f64>,
    sequence_bits: u32,
    refresh_every: Option<u64>,
    resilient: bool,
    exact: bool,
}

/// Largest period in units of delta.
const LARGEST_PERIOD: f64 = (1_u64 << 40) as f64;

impl Config {
    /// Every reconstruction is within `delta` (measurement units) of its sample, on a link that loses nothing.
    ///
    /// # Errors
    /// If `delta` is not above 0 or `2 delta` not finite.
    pub const fn new(delta: f64) -> Result<Self, Error> {
        match positive("delta", delta) {
            Ok(delta) if (2.0 * delta).is_finite() => Ok(Self {
                delta,
                period: None,
                sequence_bits: 0,
                refresh_every: None,
                resilient: false,
                exact: false,
            }),
            Ok(delta) => Err(Error::new("delta", delta, "a number whose double is finite")),
            Err(error) => Err(error),
        }
    }

    /// For an instrument whose samples are decimal numbers that are multiples of `resolution` apart: such samples are reconstructed
    /// exactly, to the last bit. Other samples are reconstructed within `resolution / 2`; samples half-way between need more bits than with
    /// [`new`](Self::new). On a circle this is the same as `new(resolution / 2)`.
    ///
    /// # Errors
    /// If `resolution` is not positive and finite, or half of it 0.
    pub fn exact(resolution: f64) -> Result<Self, Error> {
        positive("resolution", resolution)?;
        Ok(Self::new(0.5 * resolution)?.made_exact())
    }

    /// The same configuration with another error bound.
    ///
    /// # Errors
    /// As [`new`](Self::new) and [`circular`](Self::circular).
    pub fn with_delta(self, delta: f64) -> Result<Self, Error> {
        let config = Self {
            delta: Self::new(delta)?.delta,
            exact: false,
            ..self
        };
        match self.period {
            Some(period) => config.circular(period),
            None => Ok(config),
        }
    }

    /// The signal is periodic: samples are taken modulo `period` (360 for degrees), reconstructions lie in `[0, period)`,
    /// and `delta` bounds the error around the circle.
    ///
    /// # Errors
    /// If `period` is not positive and finite, or above `2^40 delta`.
    pub fn circular(mut self, period: f64) -> Result<Self, Error> {
        positive("period", period)?;
        if period / self.delta > LARGEST_PERIOD {
            return Err(Error::new("period", period, "at most 2^40 delta"));
        }
        self.period = Some(period);
        Ok(self)
    }

    /// For links that lose packets. Every packet has a counter of `sequence_bits` bits, and a flag that marks a refresh. The receiver
    /// notices a loss by the counter, unless a multiple of `2^sequence_bits` packets was lost in a row. Every `refresh_every` slots, and
    /// whenever it is asked to, the sensor sends a refresh, from which a receiver can start.
    ///
    /// # Errors
    /// If `sequence_bits` is not in `1..=16` or `refresh_every` is 0.
    pub fn resilient(mut self, sequence_bits: u32, refresh_every: Option<u64>) -> Result<Self, Error> {
        if !(1..=16).contains(&sequence_bits) {
            return Err(Error::new("sequence_bits", f64::from(sequence_bits), "a number in [1, 16]"));
        }
        if refresh_every == Some(0) {
            return Err(Error::new("refresh_every", 0.0, "at least 1 slot"));
        }
        self.sequence_bits = sequence_bits;
        self.refresh_every = refresh_every;
        self.resilient = true;
        Ok(self)
    }

    /// The same error bound for samples that are multiples of `2 delta` apart, as [`exact`](Self::exact).
    #[must_use]
    pub fn made_exact(self) -> Self {
        Self { exact: true, ..self }
    }

    /// Largest error of a reconstruction, in measurement units.
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// Distance of which the differences of samples are multiples, for [`exact`](Self::exact).
    pub fn resolution(&self) -> Option<f64> {
        self.exact.then_some(2.0 * self.delta)
    }

    /// The period of a circular signal.
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// Slots from one scheduled refresh to the next.
    pub fn refresh_every(&self) -> Option<u64> {
        self.refresh_every
    }

    /// Bits of the counter in a packet; 0 if there is none.
    pub fn sequence_bits(&self) -> u32 {
        self.sequence_bits
    }

    /// Whether packets have a counter and a refresh flag.
    pub fn is_resilient(&self) -> bool {
        self.resilient
    }
}
