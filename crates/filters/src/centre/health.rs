//! Tests whether the model still holds, from the observations that the receiver has.
//!
//! If the model is right, three sequences per sensor have mean 0 and variance 1, given the past and the other reports of the same
//! instant:
//!
//! | sequence | what changes its mean |
//! |---|---|
//! | surprise: how far `ln p(o)` is below its mean, in deviations; for values `(NIS - 1) / sqrt 2` | wrong noise variance, outliers |
//! | residual: correction by the observation, divided by its deviation | a biased sensor, a wrong initial state |
//! | product of successive residuals of one sensor | process noise too small (residuals repeat) or too large (they alternate), lost track |
//!
//! "The other reports" are those that are used, so that one wrong sensor does not condemn the others, and the order of reports decides
//! nothing. The centre's own test takes the reports one after the other by the sensors' numbers: only then are its terms independent.
//!
//! A bit whose threshold is the prediction has no surprise, since both outcomes have probability 1/2. Wrong noise then shows in the
//! product. Each sequence is tested by a two-sided cumulative sum, the residual by a second one that finds large biases sooner. Silence has no
//! residual; it is tested by [presence](super::presence).

use crate::Error;
use fewbits_numerics::bisect;
use fewbits_numerics::error::within;
use fewbits_numerics::normal::cdf;
use serde::{Deserialize, Serialize};

/// Constant subtracted at each step of a cumulative sum. This value detects shifts of half a deviation fastest.
const DRIFT: f64 = 0.25;
/// The same of the second sum of residuals: shifts of two deviations.
const LARGE_DRIFT: f64 = 1.0;
/// Terms are limited to this absolute value, so that one outlier raises no alarm.
pub(super) const CLIP: f64 = 3.0;
/// Differences of probabilities, or deviations of their logarithms, that are treated as zero.
const EQUAL: f64 = 1e-3;
/// `ln` of a ratio of probabilities below which a cell is improbable: that of a value three deviations off.
const IMPROBABLE: f64 = -4.5;
/// Number of sequences per sensor.
pub(super) const SEQUENCES: usize = 3;
/// Number of sums per sensor: one for each sequence, and the second one of residuals.
const SUMS: usize = SEQUENCES + 1;

/// One observation, standardised by its predicted distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Residual {
    pub surprise: f64,
    pub residual: f64,
    /// Probability of an observation that is at most as likely as this one.
    pub tail: f64,
    /// How far `ln p` of the observation is below that of the likeliest one, in nats.
    pub depth: f64,
}

impl Residual {
    /// Residual of a bit of probability `share`, from the sign of its correction. The other bit has the remaining probability, and the mean
    /// correction is zero. `None` if only one outcome is possible.
    pub(crate) fn of_bit(share: f64, correction: f64) -> Option<Self> {
        let other = (1.0 - share).max(f64::MIN_POSITIVE);
        // A variable of mean zero with two values and probabilities `share` and `other` has deviation one if this is its size at `share`.
        let size = (other / share).sqrt();
        // Bits of equal probability have no surprise.
        let surprise = if (share - other).abs() > EQUAL {
            size.copysign(other - share)
        } else {
            0.0
        };
        (size.is_finite() && correction != 0.0).then_some(Self {
            surprise,
            residual: size.copysign(correction),
            tail: if share < other { share } else { 1.0 },
            depth: (other / share).ln().max(0.0),
        })
    }

    /// Residual of a word, from `(ln p, correction)` of every possible word; `at` is the index of the received one. `None` if only one is
    /// possible.
    pub(crate) fn of_word(words: &[(f64, f64)], at: usize) -> Option<Self> {
        let total: f64 = words.iter().map(|w| w.0.exp()).sum();
        let shares: Vec<f64> = words.iter().map(|w| w.0.exp() / total).collect();
        let possible = || shares.iter().zip(words).filter(|(share, _)| **share > 0.0);
        let average = |of: &dyn Fn(&(f64, f64)) -> f64| possible().map(|(share, word)| share * of(word)).sum::<f64>();
        let (log_mean, mean) = (average(&|w| w.0), average(&|w| w.1));
        let log_variance = average(&|w| (w.0 - log_mean) * (w.0 - log_mean));
        let variance = average(&|w| (w.1 - mean) * (w.1 - mean));
        let (log, correction) = *words.get(at)?;
        let residual = (correction - mean) / variance.sqrt();
        // Words of equal probability have no surprise.
        let surprise = if log_variance > EQUAL * EQUAL {
            (log_mean - log) / log_variance.sqrt()
        } else {
            0.0
        };
        let highest = words.iter().map(|w| w.0).fold(f64::NEG_INFINITY, f64::max);
        let own = *shares.get(at)?;
        let tail = shares.iter().filter(|share| **share <= own * (1.0 + EQUAL)).sum();
        let depth = highest - log;
        (residual.is_finite() && surprise.is_finite()).then_some(Self {
            surprise,
            residual,
            tail,
            depth,
        })
    }

    /// Residual of a value, from `ln` of its density, the variance of the innovation, and the sign of the correction.
    pub(crate) fn of_value(log_density: f64, variance: f64, correction: f64) -> Option<Self> {
        // -2 ln N(innovation; 0, S) = innovation^2 / S + ln(2 pi S); rounding may leave a negative rest.
        let nis = (-2.0 * log_density - (std::f64::consts::TAU * variance).ln()).max(0.0);
        Self::of_normal(nis.sqrt().copysign(correction))
    }

    /// Residual of a cell, from `ln` of its probability beside the likeliest cell's and the sign of the correction. `None` if it is not improbable.
    pub(crate) fn of_cell(log_ratio: f64, correction: f64) -> Option<Self> {
        if log_ratio > IMPROBABLE {
            return None;
        }
        Self::of_normal((-2.0 * log_ratio).sqrt().copysign(correction))
    }

    /// Residual of a variable that is standard normal if the model is right. `None` if it is not finite.
    pub(crate) fn of_normal(residual: f64) -> Option<Self> {
        let nis = residual * residual;
        nis.is_finite().then(|| Self {
            surprise: (nis - 1.0) * std::f64::consts::FRAC_1_SQRT_2,
            residual,
            tail: 2.0 * cdf(-residual.abs()),
            depth: 0.5 * nis,
        })
    }
}

/// A two-sided cumulative sum.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cusum {
    #[serde(with = "fewbits_numerics::stored")]
    up: f64,
    #[serde(with = "fewbits_numerics::stored")]
    down: f64,
}

impl Cusum {
    /// Adds a term of mean 0 and variance 1. Returns which of the two sums exceeds its limit, if any. A sum never grows above the limit.
    fn add(&mut self, term: f64, Limit { drift, limit }: Limit) -> Option<Direction> {
        let term = term.clamp(-CLIP, CLIP);
        self.up = (self.up + term - drift).max(0.0);
        self.down = (self.down - term - drift).max(0.0);
        let direction = if self.up > limit {
            Direction::Up
        } else if self.down > limit {
            Direction::Down
        } else {
            return None;
        };
        (self.up, self.down) = (self.up.min(limit), self.down.min(limit));
        Some(direction)
    }
}

/// The sum that exceeded its limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Up,
    Down,
}

/// Conclusion from the three sequences together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Alarm {
    /// Observations are less likely than predicted, residuals have a mean, or they repeat.
    Contradiction,
    /// Observations are likelier than predicted, or residuals alternate: a stated noise is too large.
    Overstatement,
}

/// The drift of a cumulative sum, and its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Limit {
    drift: f64,
    limit: f64,
}

/// The limit at which a two-sided sum of standard normal terms raises one alarm in `1 / rate` steps (Siegmund's approximation:
/// `(exp(2 k b) - 2 k b - 1) / (2 k^2)` steps on one side, `k` the drift, `b` the limit plus 1.166).
fn limit(rate: f64, drift: f64) -> Limit {
    let steps = 2.0 / rate;
    let run = |b: f64| ((2.0 * drift * b).exp_m1() - 2.0 * drift * b) / (2.0 * drift * drift);
    // Each of two sides may raise half of the alarms. The run length grows with `b`; exp(200) is far above every rate allowed.
    let (low, _) = bisect::boundary(|b| run(b) < steps, 0.0, 100.0 / drift, 60);
    let limit = (low - 1.166).max(0.5);
    Limit { drift, limit }
}

/// Rates of false alarms while sensors and model are right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FalseAlarms {
    /// Rate at which a sensor is excluded by a false alarm, per observation.
    pub sensor: f64,
    /// Rate of false alarms of the whole centre, per instant.
    pub centre: f64,
}

impl Default for FalseAlarms {
    /// One in a million observations of a sensor, one in 1000 instants of the centre.
    fn default() -> Self {
        Self {
            sensor: 1e-6,
            centre: 1e-3,
        }
    }
}

impl FalseAlarms {
    /// A report is rejected if the probability of reports that are at most as likely is below this: ten times the rate of false alarms of
    /// a sensor, and at most 0.01. The loss of one report costs less than that of a sensor.
    pub(crate) fn gate(&self) -> f64 {
        (10.0 * self.sensor).min(0.01)
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        within("sensor", self.sensor, 1e-9, 0.1)?;
        within("centre", self.centre, 1e-9, 0.1)?;
        Ok(())
    }
}

/// Limits of the cumulative sums.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub sensor: SumLimits,
    pub centre: SumLimits,
    /// Probability below which a report is rejected.
    pub gate: f64,
    /// Rate at which a sensor is excluded by a false alarm.
    pub rate: f64,
}

impl Limits {
    pub(crate) fn new(rates: &FalseAlarms) -> Self {
        Self {
            sensor: SumLimits::new(rates.sensor / SUMS as f64),
            // Residuals have no part in it.
            centre: SumLimits::new(rates.centre / SEQUENCES as f64),
            gate: rates.gate(),
            rate: rates.sensor,
        }
    }
}

/// Limits of the sums of one monitor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SumLimits {
    small: Limit,
    large: Limit,
}

impl SumLimits {
    fn new(rate: f64) -> Self {
        Self {
            small: limit(rate, DRIFT),
            large: limit(rate, LARGE_DRIFT),
        }
    }
}

/// The cumulative sums of the three sequences, of one sensor or of all together.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Monitor {
    sums: [Cusum; SEQUENCES],
    /// Of residuals, for large shifts.
    large: Cusum,
}

impl Monitor {
    /// Adds one term to each sequence that has one: surprise, residual, product.
    pub(crate) fn add(&mut self, terms: [Option<f64>; SEQUENCES], limits: &SumLimits) -> Option<Alarm> {
        let [surprise, residual, product] = &mut self.sums;
        let sums = [
            (surprise, terms[0], limits.small, Alarm::Overstatement),
            (residual, terms[1], limits.small, Alarm::Contradiction),
            (&mut self.large, terms[1], limits.large, Alarm::Contradiction),
            (product, terms[2], limits.small, Alarm::Overstatement),
        ];
        let mut alarm = None;
        for (sum, term, limit, below) in sums {
            let meaning = match term.and_then(|term| sum.add(term, limit)) {
                None => continue,
                Some(Direction::Down) => below,
                Some(Direction::Up) => Alarm::Contradiction,
            };
            // A contradiction is the graver conclusion and is kept.
            if alarm != Some(Alarm::Contradiction) {
                alarm = Some(meaning);
            }
        }
        alarm
    }

    /// The largest sum that speaks for a contradiction, in parts of its limit.
    pub(crate) fn contradiction(&self, limits: &SumLimits) -> f64 {
        let ([surprise, residual, product], large) = (&self.sums, &self.large);
        let small = surprise.up.max(residual.up).max(residual.down).max(product.up) / limits.small.limit;
        small.max(large.up.max(large.down) / limits.large.limit)
    }
}

/// What a centre does with the results of its tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Health {
    /// No report is tested. All are used, except those that cannot be. For comparisons of likelihoods, and models that are known to be right.
    Off,
    /// Reports are tested and events are returned. All reports are used, except those that cannot be.
    Report,
    /// Reports that are too unlikely given the prediction and the others' are not used: less likely than ten times the rate of false alarms of a
    /// sensor, and at most 0.01. Sensors that contradict the others again and again are excluded.
    #[default]
    Exclude,
}

#[cfg(test)]
mod tests {
    use super::Residual;

    #[test]
    fn a_bit_is_a_word_of_two() {
        for (share, correction) in [(0.5, 0.3), (0.1, 2.0), (0.9, -0.2), (0.999, 1e-3)] {
            let other: f64 = 1.0 - share;
            // Corrections have mean zero.
            let words = [(f64::ln(share), correction), (other.ln(), -correction * share / other)];
            let (bit, word) = (Residual::of_bit(share, correction).unwrap(), Residual::of_word(&words, 0).unwrap());
            assert!((bit.residual - word.residual).abs() < 1e-9, "{bit:?} {word:?}");
            assert!((bit.surprise - word.surprise).abs() < 1e-9, "{bit:?} {word:?}");
        }
        assert!(Residual::of_bit(0.5, 0.0).is_none() && Residual::of_bit(0.0, 1.0).is_none());
        // A bit of small probability has a large surprise, however rare it is.
        assert!(Residual::of_bit(1e-12, 1.0).unwrap().surprise > 1e5);
    }
}
