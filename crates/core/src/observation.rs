//! What is observed of a sensor in one slot, and the link that it crosses.

use crate::bits::BitString;
use crate::message::Message;
use fewbits_numerics::ArgumentError;
#[cfg(feature = "serde")]
use fewbits_numerics::stored;
use rand::{Rng, RngExt};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// What arrives at the receiver in one slot from one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub enum Observation<R> {
    /// A report was received.
    Received(R),
    /// Nothing arrived: the sensor was silent, or its report was lost without a trace. The [`Link`] says how likely each is.
    Nothing,
    /// A report is known to be lost (a gap in sequence numbers, a failed checksum): no information.
    Lost,
}

impl<R> Observation<R> {
    /// The received report, if any.
    pub fn received(&self) -> Option<&R> {
        match self {
            Self::Received(report) => Some(report),
            Self::Nothing | Self::Lost => None,
        }
    }

    /// The same observation of a translated report.
    pub fn map<T>(self, f: impl FnOnce(R) -> T) -> Observation<T> {
        match self {
            Self::Received(report) => Observation::Received(f(report)),
            Self::Nothing => Observation::Nothing,
            Self::Lost => Observation::Lost,
        }
    }
}

impl<R> From<Option<R>> for Observation<R> {
    /// What a perfect link delivers: silence is observed as [`Observation::Nothing`].
    fn from(report: Option<R>) -> Self {
        report.map_or(Self::Nothing, Self::Received)
    }
}

/// What a receiver knows of the channel: the only place where these numbers live.
///
/// A report vanishes without a trace with probability `loss`; each bit of a report that arrives is inverted with probability
/// `crossover`, independently (a binary symmetric channel). [`Observation::Lost`] is not a matter of the link's law:
/// factors condition on it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Numbers"))]
pub struct Link {
    loss: f64,
    crossover: f64,
}

#[cfg(feature = "serde")]
stored! { Link as Numbers { loss: f64, crossover: f64 } => Link::new(loss, crossover), ArgumentError }

impl Link {
    /// A link that delivers every report as it was sent.
    pub const PERFECT: Self = Self {
        loss: 0.0,
        crossover: 0.0,
    };

    /// A link that loses a report with probability `loss` and inverts a bit with probability `crossover`.
    ///
    /// # Errors
    /// If `loss` is outside `[0, 1)` or `crossover` outside `[0, 1/2]` (beyond one half, the receiver inverts all bits).
    pub fn new(loss: f64, crossover: f64) -> Result<Self, ArgumentError> {
        if !(0.0..1.0).contains(&loss) {
            return Err(ArgumentError::new("loss", loss, "a probability in [0, 1)"));
        }
        if !(0.0..=0.5).contains(&crossover) {
            return Err(ArgumentError::new("crossover", crossover, "a probability in [0, 1/2]"));
        }
        Ok(Self { loss, crossover })
    }

    /// A link that loses a report with probability `loss`.
    ///
    /// # Errors
    /// As [`Link::new`].
    pub fn lossy(loss: f64) -> Result<Self, ArgumentError> {
        Self::new(loss, 0.0)
    }

    /// A link that inverts a bit with probability `crossover`.
    ///
    /// # Errors
    /// As [`Link::new`].
    pub fn flipping(crossover: f64) -> Result<Self, ArgumentError> {
        Self::new(0.0, crossover)
    }

    /// Probability that a report vanishes without a trace.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// Probability that a bit arrives inverted.
    pub fn crossover(&self) -> f64 {
        self.crossover
    }

    /// `p(word received | word sent, a word arrived)` for words of `bits` bits: `e^d (1 - e)^(bits - d)` with `d` bits
    /// different.
    pub fn word_probability(&self, sent: u64, received: u64, bits: u32) -> f64 {
        let different = (sent ^ received).count_ones().min(bits);
        self.crossover.powi(different as i32) * (1.0 - self.crossover).powi((bits - different) as i32)
    }

    /// Sends a report through the link: its bits, lost or inverted as the link's law says. Bits that no longer are a report
    /// arrive as [`Observation::Lost`]; silence arrives as [`Observation::Nothing`].
    ///
    /// # Errors
    /// If the report does not fit its format.
    pub fn transmit<M: Message, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        report: Option<&M>,
        format: &M::Format,
    ) -> Result<Observation<M>, crate::bits::CodecError> {
        let Some(report) = report else {
            return Ok(Observation::Nothing);
        };
        let sent = report.to_bits(format)?;
        if self.loss > 0.0 && rng.random::<f64>() < self.loss {
            return Ok(Observation::Nothing);
        }
        let received = self.flip(rng, sent);
        Ok(M::from_bits(format, &received).map_or(Observation::Lost, Observation::Received))
    }

    /// Inverts each bit with the crossover probability.
    fn flip<R: Rng + ?Sized>(&self, rng: &mut R, bits: BitString) -> BitString {
        if self.crossover == 0.0 {
            return bits;
        }
        (0..bits.bits()).fold(bits, |bits, i| {
            if rng.random::<f64>() < self.crossover {
                bits.with_flipped(i)
            } else {
                bits
            }
        })
    }
}
