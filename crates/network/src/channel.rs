//! What happens to a frame on the way, and what the receiver may know of it beforehand.

use crate::units::Seconds;
use fewbits_core::{ArgumentError, Link};
use fewbits_numerics::error::{positive, within};
use fewbits_numerics::normal;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// How likely a frame is lost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Loss {
    /// The same over every distance.
    Fixed(f64),
    /// Log-normal shadowing, drawn anew for each frame: received power falls by `10 n log10 d` dB with a normal deviation of `sigma` dB,
    /// so that `loss = Phi(10 n log10(d / d_half) / sigma)` (Rappaport, *Wireless communications*, 2nd edition, eqs. 4.69-4.72).
    Shadowing {
        /// Distance at which every other frame is lost, metres.
        half: f64,
        /// Path-loss exponent `n`.
        exponent: f64,
        /// Standard deviation of the shadowing, dB.
        deviation: f64,
    },
}

impl Loss {
    /// Probability that a frame over `distance` metres is lost.
    pub fn probability(&self, distance: f64) -> f64 {
        match *self {
            Self::Fixed(loss) => loss,
            Self::Shadowing {
                half,
                exponent,
                deviation,
            } => normal::cdf(10.0 * exponent * (distance / half).log10() / deviation),
        }
    }
}

/// What the air does to frames; every frame and receiver is independent of the others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// How likely a frame is lost.
    pub loss: Loss,
    /// Probability that a bit is inverted.
    pub crossover: f64,
    /// Delay of every frame, besides its time on air.
    pub delay: Seconds,
    /// Mean of an exponential further delay.
    pub jitter: Seconds,
    /// Probability that a frame arrives twice, the second time after another delay.
    pub duplication: f64,
    /// Probability that a frame is held back by `held`.
    pub reordering: f64,
    /// How long a frame is held back, so that later ones overtake it.
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

    /// Loses each frame with the given probability.
    ///
    /// # Errors
    /// If it is outside `[0, 1]`.
    pub fn lossy(loss: f64) -> Result<Self, ArgumentError> {
        Self {
            loss: Loss::Fixed(loss),
            ..Self::PERFECT
        }
        .checked()
    }

    /// Inverts each bit with the given probability.
    ///
    /// # Errors
    /// If it is outside `[0, 1/2]`.
    pub fn flipping(crossover: f64) -> Result<Self, ArgumentError> {
        Self {
            crossover,
            ..Self::PERFECT
        }
        .checked()
    }

    /// The channel, if its numbers are probabilities and lengths.
    ///
    /// # Errors
    /// If one is not.
    pub fn checked(self) -> Result<Self, ArgumentError> {
        match self.loss {
            Loss::Fixed(loss) => {
                within("loss", loss, 0.0, 1.0)?;
            }
            Loss::Shadowing {
                half,
                exponent,
                deviation,
            } => {
                positive("half", half)?;
                positive("exponent", exponent)?;
                positive("deviation", deviation)?;
            }
        }
        within("crossover", self.crossover, 0.0, 0.5)?;
        within("duplication", self.duplication, 0.0, 1.0)?;
        within("reordering", self.reordering, 0.0, 1.0)?;
        Ok(self)
    }

    /// What a receiver knows of reports of `frame_bits` bits over `distance` metres that follow a question of as many bits
    /// (`None` if none is asked): a report is lost with the question or by itself. Under a whole frame check inverted bits are losses too
    /// (known ones, where the sender is); without one over the payload, its bits arrive inverted.
    ///
    /// # Errors
    /// None for a checked channel.
    pub fn link(
        &self,
        distance: f64,
        question_bits: Option<usize>,
        frame_bits: usize,
        check: Check,
    ) -> Result<Link, ArgumentError> {
        let arrives = 1.0 - self.loss.probability(distance);
        let intact = |bits: usize| arrives * (1.0 - self.crossover).powi(i32::try_from(bits).unwrap_or(i32::MAX));
        let answered = question_bits.map_or(1.0, intact);
        match check {
            Check::Whole => Link::lossy(1.0 - answered * arrives),
            Check::Header => Link::new(1.0 - answered * intact(frame_bits), self.crossover),
        }
    }

    /// Whether nothing ever happens to a frame but the delay.
    fn is_clean(&self) -> bool {
        self.loss == Loss::Fixed(0.0)
            && self.crossover == 0.0
            && self.jitter == Seconds::ZERO
            && self.duplication == 0.0
            && self.reordering == 0.0
    }

    /// The copies of a frame of `bits` bits that arrive over `distance` metres: none, one or two.
    pub(crate) fn copies<R: Rng>(&self, rng: impl FnOnce() -> R, distance: f64, bits: usize, copies: &mut Vec<Copy>) {
        if self.is_clean() {
            copies.push(Copy {
                delay: self.delay,
                flipped: Vec::new(),
            });
            return;
        }
        let mut rng = rng();
        if rng.random::<f64>() < self.loss.probability(distance) {
            return;
        }
        let twice = self.duplication > 0.0 && rng.random::<f64>() < self.duplication;
        for _ in 0..1 + usize::from(twice) {
            let mut delay = self.delay.value();
            if self.jitter > Seconds::ZERO {
                delay -= self.jitter.value() * (-rng.random::<f64>()).ln_1p();
            }
            if self.reordering > 0.0 && rng.random::<f64>() < self.reordering {
                delay += self.held.value();
            }
            let mut flipped = Vec::new();
            if self.crossover > 0.0 {
                flipped.extend((0..bits as u32).filter(|_| rng.random::<f64>() < self.crossover));
            }
            copies.push(Copy {
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

/// One arrival of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Copy {
    /// After the frame's time on air.
    pub delay: Seconds,
    /// Bits that were inverted.
    pub flipped: Vec<u32>,
}

/// What the frame check covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Check {
    /// Header and payload: a frame with an inverted bit is dropped.
    #[default]
    Whole,
    /// The header alone, for schemes whose factor knows of inverted bits.
    Header,
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_monte_carlo::Stream;

    #[test]
    fn shadowing_loses_half_at_half_and_more_beyond() {
        let loss = Loss::Shadowing {
            half: 30.0,
            exponent: 3.0,
            deviation: 4.0,
        };
        assert!((loss.probability(30.0) - 0.5).abs() < 1e-15);
        assert!(loss.probability(15.0) < 0.02 && loss.probability(60.0) > 0.98);
        assert_eq!(loss.probability(0.0), 0.0);
        assert!(
            Channel {
                loss,
                ..Channel::PERFECT
            }
            .checked()
            .is_ok()
        );
        let none = Loss::Shadowing {
            half: 0.0,
            exponent: 3.0,
            deviation: 4.0,
        };
        assert!(
            Channel {
                loss: none,
                ..Channel::PERFECT
            }
            .checked()
            .is_err()
        );
        assert!(Channel::lossy(1.5).is_err() && Channel::flipping(0.6).is_err());
    }

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
            channel.copies(|| Stream::new(1).indexed(trial).rng(), 10.0, 8, &mut copies);
            arrived += usize::from(!copies.is_empty());
            twice += usize::from(copies.len() == 2);
            flips += copies.first().map_or(0, |copy| copy.flipped.len());
        }
        let near = |count: usize, p: f64, n: f64| (count as f64 - n * p).abs() < 4.0 * (n * p * (1.0 - p)).sqrt();
        assert!(near(arrived, 0.8, trials as f64));
        assert!(near(twice, 0.1, arrived as f64) && near(flips, 0.05, 8.0 * arrived as f64));
        let link = channel.link(10.0, Some(8), 8, Check::Header).unwrap();
        assert!((link.loss() - (1.0 - 0.64 * 0.95_f64.powi(16))).abs() < 1e-12);
        assert_eq!(link.crossover(), 0.05);
        assert_eq!(channel.link(10.0, None, 8, Check::Whole).unwrap().crossover(), 0.0);
        assert_eq!(
            Channel::lossy(1.0)
                .unwrap()
                .link(1.0, None, 1, Check::Whole)
                .unwrap()
                .arrival(),
            0.0
        );
    }
}
