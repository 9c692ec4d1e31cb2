//! What both ends agree on beforehand.

use crate::error::{Error, positive};

/// The agreement of a sensor and its receiver: the accuracy, and how losses are survived.
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
    /// Every reconstruction is within `delta` (measurement units) of its sample, over a link that loses nothing.
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

    /// For an instrument whose samples are decimal numbers a multiple of `resolution` apart: these return exactly, to the last
    /// bit. Other samples are reconstructed within `resolution / 2`, but cost more than with [`new`](Self::new) where they lie
    /// half-way. Around a circle this is the same as `new(resolution / 2)`.
    ///
    /// # Errors
    /// If `resolution` is not positive and finite, or half of it 0.
    pub fn exact(resolution: f64) -> Result<Self, Error> {
        positive("resolution", resolution)?;
        Ok(Self::new(0.5 * resolution)?.made_exact())
    }

    /// The same agreement with another bound.
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

    /// The signal lives on a circle: samples are taken modulo `period` (360 for degrees), reconstructions lie in `[0, period)`,
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

    /// For links that lose packets: every packet counts up a number of `sequence_bits` bits (by which the receiver notices a
    /// loss unless a multiple of `2^sequence_bits` packets vanished in a row) and has a flag that marks a refresh; every
    /// `refresh_every` slots, and whenever it is asked to, the sensor sends a refresh, from which a receiver can start.
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

    /// The same bound for samples that are known to be multiples of `2 delta` apart, as [`exact`](Self::exact).
    #[must_use]
    pub fn made_exact(self) -> Self {
        Self { exact: true, ..self }
    }

    /// The largest error of a reconstruction.
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// What samples are a multiple of apart, if [`exact`](Self::exact).
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

    /// Bits of the counter in a packet.
    pub fn sequence_bits(&self) -> u32 {
        self.sequence_bits
    }

    /// Whether packets have a counter and a flag.
    pub fn is_resilient(&self) -> bool {
        self.resilient
    }
}
