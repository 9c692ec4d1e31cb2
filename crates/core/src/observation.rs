//! What a receiver observes of a sensor in one slot, and the link between them.

use crate::bits::BitString;
use crate::error::Error;
use crate::message::Message;
use fewbits_numerics::ArgumentError;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// What a receiver observes, in one slot, of one sensor that was asked to report.
///
/// With `s(m)` the probability that the sensor is silent, and a [`Link`] of loss `l` and erasure `e`:
///
/// | observation | probability given `m` |
/// |---|---|
/// | `Received(r)` | `(1 - l - e) p(r | m)` |
/// | `Nothing` | `s(m) + l (1 - s(m))` |
/// | `Lost` | `e (1 - s(m))` |
///
/// They sum to one for every `m`. A sensor that was not asked (asleep, out of turn, known to be switched off) gives no observation
/// and no factor at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Observation<R> {
    /// A report was received.
    Received(R),
    /// Nothing arrived: the sensor was silent, or its report was lost without a trace. The [`Link`] says how likely each is.
    Nothing,
    /// A report was sent but not understood (a gap in sequence numbers, a failed checksum). The receiver learns only that the sensor
    /// was not silent: `p(spoke | m)`, which is 1 for sensors that always report.
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
}

impl<R> From<Option<R>> for Observation<R> {
    /// The observation over a perfect link: silence becomes [`Observation::Nothing`].
    fn from(report: Option<R>) -> Self {
        report.map_or(Self::Nothing, Self::Received)
    }
}

/// The receiver's model of the channel: the probabilities of loss, erasure and bit errors.
///
/// A report that was sent vanishes without a trace with probability `loss`, is known to be lost with probability `erasure`, and
/// arrives otherwise. Each bit of a report that arrives is inverted with probability `crossover`, independently (a binary symmetric
/// channel). A receiver that cannot tell a lost report from silence has `erasure = 0`.
///
/// ```
/// use fewbits_core::Link;
/// let link = Link::new(0.1, 0.01)?.with_erasure(0.2)?;
/// assert!((link.arrival() - 0.7).abs() < 1e-15);
/// assert!(Link::lossy(0.9)?.with_erasure(0.2).is_err());
/// # Ok::<(), fewbits_core::ArgumentError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct Link {
    loss: f64,
    erasure: f64,
    crossover: f64,
}

/// The stored form of [`Link`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    loss: f64,
    #[serde(default)]
    erasure: f64,
    crossover: f64,
}

impl TryFrom<Numbers> for Link {
    type Error = ArgumentError;

    fn try_from(parts: Numbers) -> Result<Self, ArgumentError> {
        Link::new(parts.loss, parts.crossover)?.with_erasure(parts.erasure)
    }
}

impl Link {
    /// A link that delivers every report as it was sent.
    pub const PERFECT: Self = Self {
        loss: 0.0,
        erasure: 0.0,
        crossover: 0.0,
    };

    /// A link that loses a report without a trace with probability `loss` and inverts a bit with probability `crossover`.
    ///
    /// With `loss` 1 nothing ever arrives; a receiver can describe a dead sensor by such a link. A report that arrives all the same is
    /// [`Error::Impossible`].
    ///
    /// # Errors
    /// If `loss` is outside `[0, 1]` or `crossover` outside `[0, 1/2]` (beyond one half, the receiver inverts all bits).
    pub fn new(loss: f64, crossover: f64) -> Result<Self, ArgumentError> {
        if !(0.0..=1.0).contains(&loss) {
            return Err(ArgumentError::new("loss", loss, "a probability in [0, 1]"));
        }
        if !(0.0..=0.5).contains(&crossover) {
            return Err(ArgumentError::new("crossover", crossover, "a probability in [0, 1/2]"));
        }
        Ok(Self {
            loss,
            erasure: 0.0,
            crossover,
        })
    }

    /// The same link, on which the receiver also notices the loss of a report with probability `erasure`.
    ///
    /// # Errors
    /// If `erasure` is negative, or if `loss + erasure` exceeds one.
    pub fn with_erasure(self, erasure: f64) -> Result<Self, ArgumentError> {
        if erasure >= 0.0 && self.loss + erasure <= 1.0 {
            return Ok(Self { erasure, ..self });
        }
        let expected = format!("a probability of at most 1 together with the loss {}", self.loss);
        Err(ArgumentError::new("erasure", erasure, expected))
    }

    /// A link that loses a report without a trace with probability `loss`.
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

    /// Probability that a report that was sent vanishes without a trace.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// Probability that a report that was sent is known to be lost.
    pub fn erasure(&self) -> f64 {
        self.erasure
    }

    /// Probability that a bit arrives inverted.
    pub fn crossover(&self) -> f64 {
        self.crossover
    }

    /// Probability that a report that was sent arrives: `1 - loss - erasure`.
    pub fn arrival(&self) -> f64 {
        (1.0 - (self.loss + self.erasure)).max(0.0)
    }

    /// [`Link::arrival`], as a factor of the likelihood of a report that did arrive.
    ///
    /// # Errors
    /// [`Error::Impossible`] if nothing arrives over this link.
    pub fn of_received(&self) -> Result<f64, Error> {
        match self.arrival() {
            0.0 => Err(Error::Impossible),
            arrival => Ok(arrival),
        }
    }

    /// Factor of `p(spoke | m)` in the likelihood of [`Observation::Lost`]: the erasure, or 1 if the erasure is 0.
    ///
    /// `Lost` observed over a link with erasure 0 contradicts the link model, not the sensor. The factor is then conditioned on the loss
    /// and is `p(spoke | m)` alone. This choice does not change the posterior, since a positive erasure cancels from it.
    pub fn lost_given_sent(&self) -> f64 {
        if self.erasure > 0.0 { self.erasure } else { 1.0 }
    }

    /// Probability of `observation` given that a report was sent, whatever the report: arrival, loss, or
    /// [`lost_given_sent`](Self::lost_given_sent). It is the whole factor of a missing report if the sensor always speaks.
    pub fn delivery<R>(&self, observation: &Observation<R>) -> f64 {
        match observation {
            Observation::Received(_) => self.arrival(),
            Observation::Nothing => self.loss,
            Observation::Lost => self.lost_given_sent(),
        }
    }

    /// `p(word received | word sent, a word arrived)` for words of `bits` bits: `c^d (1 - c)^(bits - d)` with crossover `c` and `d`
    /// different bits.
    pub fn word_probability(&self, sent: u64, received: u64, bits: u32) -> f64 {
        let different = (sent ^ received).count_ones().min(bits);
        self.crossover.powi(different as i32) * (1.0 - self.crossover).powi((bits - different) as i32)
    }

    /// `p(word arrives as received | cell i)` of a sensor that sends one word of `bits` bits for each cell: one entry per word of `sent`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if nothing arrives over this link.
    pub(crate) fn received_given_words(
        &self,
        sent: impl Iterator<Item = u64>,
        received: u64,
        bits: u32,
    ) -> Result<Vec<f64>, Error> {
        let arrives = self.of_received()?;
        Ok(sent
            .map(|word| arrives * self.word_probability(word, received, bits))
            .collect())
    }

    /// Sends a report through the link at random: it is lost, or each of its bits may be inverted. Bits that do not decode to a report
    /// arrive as [`Observation::Lost`] (law 3 of [`Scheme`](crate::Scheme)); silence arrives as [`Observation::Nothing`].
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
        // One draw decides between loss without a trace, a loss that the receiver notices, and arrival.
        let missing = self.loss + self.erasure;
        if missing > 0.0 {
            let u = rng.random::<f64>();
            if u < missing {
                return Ok(if u < self.loss {
                    Observation::Nothing
                } else {
                    Observation::Lost
                });
            }
        }
        // Inverted bits that form no report of this format are noticed by the receiver.
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
