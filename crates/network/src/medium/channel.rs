//! The channel: loss, inverted bits and delay of frames, and the link model that a receiver assumes.

use super::loss::Loss;
use crate::units::Seconds;
use fewbits_core::{ArgumentError, Link};
use fewbits_numerics::error::within;
use fewbits_protocol::Check;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Loss, inverted bits, delay, duplication and reordering of frames. They are independent for every frame and receiver, except for the
/// state of [`Loss::Burst`]. Only bits of [`Frame`](crate::Frame)s are inverted; preambles and link headers are always received.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Model of the loss of frames.
    pub loss: Loss,
    /// Probability that a bit is inverted.
    pub crossover: f64,
    /// Delay of every frame after its time on air.
    pub delay: Seconds,
    /// Mean of an additional exponential delay.
    pub jitter: Seconds,
    /// Probability that a frame arrives twice, the second time after another delay.
    pub duplication: f64,
    /// Probability that a frame is further delayed by [`held`](Self::held).
    pub reordering: f64,
    /// Additional delay of such a frame; later frames overtake it.
    pub held: Seconds,
}

impl Channel {
    /// Every frame arrives once, as it was sent.
    pub const PERFECT: Self = Self {
        loss: Loss::Fixed(0.0),
        crossover: 0.0,
        delay: Seconds::ZERO,
        jitter: Seconds::ZERO,
        duplication: 0.0,
        reordering: 0.0,
        held: Seconds::ZERO,
    };

    /// A channel that loses each frame with the given probability and does nothing else.
    ///
    /// # Errors
    /// If `loss` is outside `[0, 1]`.
    pub fn lossy(loss: f64) -> Result<Self, ArgumentError> {
        Self {
            loss: Loss::Fixed(loss),
            ..Self::PERFECT
        }
        .checked()
    }

    /// A channel that inverts each bit with the given probability and does nothing else.
    ///
    /// # Errors
    /// If `crossover` is outside `[0, 1/2]`.
    pub fn flipping(crossover: f64) -> Result<Self, ArgumentError> {
        Self {
            crossover,
            ..Self::PERFECT
        }
        .checked()
    }

    /// Returns the channel if its probabilities and delays are valid.
    ///
    /// # Errors
    /// If one of them is not.
    pub fn checked(self) -> Result<Self, ArgumentError> {
        self.loss.checked()?;
        within("crossover", self.crossover, 0.0, 0.5)?;
        within("duplication", self.duplication, 0.0, 1.0)?;
        within("reordering", self.reordering, 0.0, 1.0)?;
        Ok(self)
    }

    /// The [`Link`] that a receiver assumes for the reports of one sensor, each sent once. `Link::loss` is the probability that nothing
    /// arrives although a report would have been sent: the question did not arrive intact, or the report did not arrive.
    ///
    /// A report with damage in the part that its check covers is observed as `Lost`; its slot tells who sent it. Damage to
    /// a payload that the check does not cover is `Link::crossover`.
    ///
    /// * `distance`: distance between sensor and receiver in metres.
    /// * `question_bits`: length of the question's whole frame, which the sensor must receive intact; `None` if nothing is asked.
    ///
    /// # Errors
    /// Never for a [`checked`](Self::checked) channel.
    pub fn link(&self, distance: f64, question_bits: Option<usize>, check: Check) -> Result<Link, ArgumentError> {
        let arrives = 1.0 - self.loss.probability(distance);
        let asked = question_bits.map_or(1.0, |bits| arrives * self.intact(bits));
        let crossover = match check {
            Check::Whole => 0.0,
            Check::Header => self.crossover,
        };
        Link::new(1.0 - asked * arrives, crossover)
    }

    /// Probability that none of `bits` bits is inverted.
    fn intact(&self, bits: usize) -> f64 {
        (bits as f64 * (-self.crossover).ln_1p()).exp()
    }

    /// Whether the channel with `loss` only delays frames.
    pub(crate) fn is_clean(&self, loss: &Loss) -> bool {
        *loss == Loss::Fixed(0.0)
            && self.crossover == 0.0
            && self.jitter == Seconds::ZERO
            && self.duplication == 0.0
            && self.reordering == 0.0
    }

    /// Draws the copies of a frame of `bits` bits that arrive: none, one or two. The frame is lost with probability `loss`.
    pub(crate) fn copies<R: Rng>(&self, rng: &mut R, loss: f64, bits: usize, copies: &mut Vec<ReceivedCopy>) {
        if rng.random::<f64>() < loss {
            return;
        }
        let twice = self.duplication > 0.0 && rng.random::<f64>() < self.duplication;
        for _ in 0..1 + usize::from(twice) {
            let mut delay = self.delay.value();
            if self.jitter > Seconds::ZERO {
                // An exponential delay by inversion; `ln_1p(-u)` keeps u near zero exact.
                delay -= self.jitter.value() * (-rng.random::<f64>()).ln_1p();
            }
            // A copy that is held back arrives after later frames.
            if self.reordering > 0.0 && rng.random::<f64>() < self.reordering {
                delay += self.held.value();
            }
            let mut flipped = Vec::new();
            if self.crossover > 0.0 {
                flipped.extend((0..bits as u32).filter(|_| rng.random::<f64>() < self.crossover));
            }
            copies.push(ReceivedCopy {
                delay: Seconds::trusted(delay),
                flipped,
            });
        }
    }
}

impl Default for Channel {
    fn default() -> Self {
        Self::PERFECT
    }
}

/// A frame as it arrived at one receiver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceivedCopy {
    /// Delay after the frame's time on air.
    pub delay: Seconds,
    /// Indices of the bits that were inverted.
    pub flipped: Vec<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_monte_carlo::Stream;

    #[test]
    fn frequencies_are_what_the_receiver_knows() {
        let channel = Channel {
            loss: Loss::Fixed(0.2),
            crossover: 0.05,
            duplication: 0.1,
            ..Channel::PERFECT
        };
        let (mut arrived, mut twice, mut flips) = (0, 0, 0);
        let trials = 20_000;
        for trial in 0..trials {
            let mut copies = Vec::new();
            channel.copies(&mut Stream::new(1).indexed(trial).rng(), 0.2, 8, &mut copies);
            arrived += usize::from(!copies.is_empty());
            twice += usize::from(copies.len() == 2);
            flips += copies.first().map_or(0, |copy| copy.flipped.len());
        }
        let near = |count: usize, p: f64, n: f64| (count as f64 - n * p).abs() < 4.0 * (n * p * (1.0 - p)).sqrt();
        assert!(near(arrived, 0.8, trials as f64));
        assert!(near(twice, 0.1, arrived as f64) && near(flips, 0.05, 8.0 * arrived as f64));
        assert!(Channel::lossy(1.5).is_err() && Channel::flipping(0.6).is_err());
        let link = channel.link(10.0, Some(8), Check::Header).unwrap();
        assert!((link.loss() - (1.0 - 0.64 * 0.95_f64.powi(8))).abs() < 1e-12);
        assert_eq!(link.crossover(), 0.05);
        assert_eq!(channel.link(10.0, None, Check::Whole).unwrap().crossover(), 0.0);
        assert_eq!(
            Channel::lossy(1.0)
                .unwrap()
                .link(1.0, None, Check::Whole)
                .unwrap()
                .arrival(),
            0.0
        );
    }
}
