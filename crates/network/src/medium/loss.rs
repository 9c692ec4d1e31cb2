//! Models of the loss of frames: fixed, by distance, or in bursts.

use crate::units::{Instant, Seconds};
use fewbits_core::ArgumentError;
use fewbits_numerics::error::{positive, within};
use fewbits_numerics::normal;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Model of the loss of frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Loss {
    /// The same probability over every distance.
    Fixed(f64),
    /// Log-normal shadowing, drawn anew for each frame: received power falls by `10 n log10 d` dB with a normal deviation of `sigma` dB,
    /// so that `loss = Phi(10 n log10(d / d_half) / sigma)` (Rappaport, *Wireless communications*, 2nd edition, eqs. 4.69-4.72).
    Shadowing {
        /// Distance at which half of the frames are lost (`d_half`), metres.
        half: f64,
        /// Path-loss exponent `n`.
        exponent: f64,
        /// Standard deviation of the shadowing, dB.
        deviation: f64,
    },
    /// Bursts: the link alternates between a good and a bad state. The durations are exponential and do not depend on traffic (Gilbert,
    /// *Capacity of a burst-noise channel*, Bell System Technical Journal 39, 1960; Elliott, the same journal 42, 1963; here in continuous
    /// time). Each direction of each link has its own state.
    Burst {
        /// Probability of loss in the good state.
        good: f64,
        /// Probability of loss in the bad state.
        bad: f64,
        /// Mean duration of the good state.
        mean_good: Seconds,
        /// Mean duration of the bad state.
        mean_bad: Seconds,
    },
}

/// State of a link with [`Loss::Burst`] at the time of its last frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct BurstState {
    at: Instant,
    is_bad: bool,
}

impl Loss {
    /// # Errors
    /// If a probability or length is out of range.
    pub(crate) fn checked(self) -> Result<Self, ArgumentError> {
        match self {
            Self::Fixed(loss) => {
                within("loss", loss, 0.0, 1.0)?;
            }
            Self::Shadowing {
                half,
                exponent,
                deviation,
            } => {
                positive("half", half)?;
                positive("exponent", exponent)?;
                positive("deviation", deviation)?;
            }
            Self::Burst {
                good,
                bad,
                mean_good,
                mean_bad,
            } => {
                within("good", good, 0.0, 1.0)?;
                within("bad", bad, 0.0, 1.0)?;
                positive("mean_good", mean_good.value())?;
                positive("mean_bad", mean_bad.value())?;
            }
        }
        Ok(self)
    }

    /// Probability that a frame is lost now. For bursts it draws the state given the state at the last frame (`None` before the first):
    /// `P(bad) = b + (was_bad - b) exp(-t (1 / mean_good + 1 / mean_bad))` after a time `t`, with the stationary probability `b` of the bad
    /// state.
    pub(crate) fn drawn<R: Rng>(
        &self,
        rng: &mut R,
        distance: f64,
        now: Instant,
        burst: impl FnOnce() -> Option<BurstState>,
    ) -> (f64, Option<BurstState>) {
        let Self::Burst {
            good,
            bad,
            mean_good,
            mean_bad,
        } = *self
        else {
            return (self.probability(distance), None);
        };
        // The two-state Markov chain in continuous time (Gilbert-Elliott): the dependence on the state at the last frame has decayed
        // exponentially.
        let share = mean_bad.value() / (mean_good.value() + mean_bad.value());
        let chance = burst().map_or(share, |before| {
            let elapsed = (now.since_start() - before.at.since_start()).value();
            let kept = (-elapsed * (1.0 / mean_good.value() + 1.0 / mean_bad.value())).exp();
            let was = if before.is_bad { 1.0 } else { 0.0 };
            share + (was - share) * kept
        });
        let is_bad = rng.random::<f64>() < chance;
        (if is_bad { bad } else { good }, Some(BurstState { at: now, is_bad }))
    }

    /// Probability that a frame over `distance` metres is lost. For bursts it is the average over both states.
    pub(crate) fn probability(&self, distance: f64) -> f64 {
        match *self {
            Self::Burst {
                good,
                bad,
                mean_good,
                mean_bad,
            } => (good * mean_good.value() + bad * mean_bad.value()) / (mean_good.value() + mean_bad.value()),
            Self::Fixed(loss) => loss,
            Self::Shadowing {
                half,
                exponent,
                deviation,
            } => normal::cdf(10.0 * exponent * (distance / half).log10() / deviation),
        }
    }
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
        assert!(loss.checked().is_ok());
        let none = Loss::Shadowing {
            half: 0.0,
            exponent: 3.0,
            deviation: 4.0,
        };
        assert!(none.checked().is_err());
        assert!(Loss::Fixed(1.5).checked().is_err());
    }

    /// Shares and lengths of bursts on a grid of frames 10 ms apart, against the continuous-time chain.
    #[test]
    fn bursts_have_the_share_and_length_of_the_chain() {
        let seconds = |s| Seconds::new(s).unwrap();
        let loss = Loss::Burst {
            good: 0.0,
            bad: 1.0,
            mean_good: seconds(0.9),
            mean_bad: seconds(0.1),
        };
        assert!((loss.probability(1.0) - 0.1).abs() < 1e-15);
        let mut rng = Stream::new(3).rng();
        let (mut state, mut lost, mut repeated, frames) = (None, 0.0, 0.0, 200_000);
        for k in 0..frames {
            let was_bad = state.is_some_and(|s: BurstState| s.is_bad);
            let (p, next) = loss.drawn(&mut rng, 1.0, Instant(k * 10_000_000), || state);
            state = next;
            lost += p;
            repeated += if was_bad { p } else { 0.0 };
        }
        // P(bad again after 10 ms) = .1 + .9 exp(-.01 (1 / .9 + 1 / .1)).
        let again = 0.1 + 0.9 * (-0.01_f64 * (1.0 / 0.9 + 10.0)).exp();
        // Neighbouring frames are dependent: the variance of the share is (1 + c) / (1 - c) times the binomial one, c = exp(-.111).
        let spread = (0.09 * 17.9 / frames as f64).sqrt();
        assert!((lost / frames as f64 - 0.1).abs() < 4.0 * spread, "{lost}");
        let spread = (again * (1.0 - again) / lost).sqrt();
        assert!((repeated / lost - again).abs() < 4.0 * spread, "{} {again}", repeated / lost);
        assert!(
            Loss::Burst {
                good: 0.0,
                bad: 1.5,
                mean_good: seconds(1.0),
                mean_bad: seconds(1.0)
            }
            .checked()
            .is_err()
        );
        assert!(
            Loss::Burst {
                good: 0.0,
                bad: 1.0,
                mean_good: seconds(0.0),
                mean_bad: seconds(1.0)
            }
            .checked()
            .is_err()
        );
    }
}
