//! Whether a sensor is stuck: it repeats one value, although its values hardly ever repeated before.
//!
//! ```text
//! of n pairs of successive values e were equal, by rounding for example; the next k pairs are equal with probability
//!     prod_{i < k} (e + 1/2 + i) / (n + 1 + i)                     Beta(1/2, 1/2) as the prior of the share: Krichevsky and Trofimov 1981
//! stuck        if that falls below the rate of false alarms of a sensor, after four repetitions at least
//! moves again  at the first other value
//! ```
//! Values that are rounded coarsely repeat while the level rests, however often they changed before. So only a sensor is judged whose values moved by
//! less than a quarter of its noise at least once: rounding to such steps is less than one part in 190 of the noise's variance.

use crate::calibration::wrapped;
use fewbits_numerics::Runs;
use serde::{Deserialize, Serialize};

/// Fewest repetitions in a row.
const FEWEST: u32 = 4;
/// Largest step of the values, in deviations of the noise.
const FINE: f64 = 0.25;
/// Largest share of pairs that were equal before.
const SELDOM: f64 = 0.1;

/// Largest square of a difference of successive values that agree, in its variance: one in 10^5 is larger.
const AGREES: f64 = 19.5;

/// The values of one sensor, as far as they repeat.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Repeats {
    #[serde(flatten)]
    pub runs: Runs,
    /// Smallest difference of two successive values that is not zero.
    #[serde(with = "fewbits_numerics::stored")]
    step: f64,
    /// `ln` of the probability of the repetitions in the present run.
    #[serde(with = "fewbits_numerics::stored")]
    log_probability: f64,
    pub is_stuck: bool,
}

/// What a value shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Repeated {
    /// Nothing new.
    Usual,
    /// So many repetitions are too improbable.
    Suspect,
    /// The first other value of a sensor that was stuck.
    MovesAgain,
}

impl Repeats {
    pub(crate) fn new() -> Self {
        Self {
            runs: Runs::default(),
            step: f64::INFINITY,
            log_probability: 0.0,
            is_stuck: false,
        }
    }

    /// Whether a value agrees with the one before it, whose difference has this variance. A repetition of a sensor that hardly ever repeats itself does
    /// not: wild values are often all the same.
    pub(crate) fn agrees(&self, value: f64, variance: f64, period: Option<f64>) -> bool {
        let Some(last) = self.runs.last else { return true };
        let is_repeated = last == value && self.is_seldom() && self.runs.pairs > 0;
        !is_repeated && wrapped(value - last, period).powi(2) <= AGREES * variance
    }

    fn is_seldom(&self) -> bool {
        f64::from(self.runs.equal) <= SELDOM * f64::from(self.runs.pairs)
    }

    /// Adds a value, of noise of this variance. `rate`: of false alarms.
    pub(crate) fn add(&mut self, value: f64, variance: f64, rate: f64) -> Repeated {
        if self.runs.last == Some(value) {
            let before = f64::from(self.runs.repetitions);
            let share = (f64::from(self.runs.equal) + 0.5 + before) / (f64::from(self.runs.pairs) + 1.0 + before);
            self.log_probability += share.ln();
            self.runs.add(value);
            let is_fine = self.step <= FINE * variance.sqrt();
            let is_improbable = self.runs.repetitions >= FEWEST && self.log_probability < rate.ln();
            return if is_improbable && self.is_seldom() && is_fine {
                Repeated::Suspect
            } else {
                Repeated::Usual
            };
        }
        let was_stuck = std::mem::take(&mut self.is_stuck);
        if was_stuck {
            // Values of a sensor that was stuck say nothing about the others.
            self.runs.repetitions = 0;
        }
        if let Some(last) = self.runs.add(value) {
            self.step = self.step.min((value - last).abs());
        }
        self.log_probability = 0.0;
        if was_stuck {
            Repeated::MovesAgain
        } else {
            Repeated::Usual
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Repeated, Repeats};
    use fewbits_numerics::Runs;

    /// Number of repetitions after which a sensor of these values is suspect.
    fn found_after(values: &[f64], variance: f64, most: usize) -> Option<usize> {
        let mut repeats = Repeats::new();
        for value in values {
            assert_eq!(repeats.add(*value, variance, 1e-6), Repeated::Usual);
        }
        (1..=most).find(|_| repeats.add(values[values.len() - 1], variance, 1e-6) == Repeated::Suspect)
    }

    #[test]
    fn the_more_values_moved_before_the_sooner_a_sensor_is_stuck() {
        let moving = |count: u32| (0..count).map(|i| (f64::from(i) * 0.7).sin()).collect::<Vec<_>>();
        // The product by hand: of 1 + 49 pairs none is equal, (.5 / 50) (1.5 / 51) (2.5 / 52) (3.5 / 53) = 9.3e-7.
        assert_eq!(found_after(&moving(50), 1.0, 10), Some(4));
        assert_eq!(found_after(&moving(500), 1.0, 10), Some(4));
        // Of 19 pairs: 1.3e-6 after six, 3.2e-7 after seven.
        assert_eq!(found_after(&moving(20), 1.0, 20), Some(7));
        assert_eq!(found_after(&[1.0], 1.0, 1000), None);
    }

    #[test]
    fn flat_stored_fields_are_restored() {
        let text = r#"{"last":1.5,"step":"inf","pairs":9,"equal":1,"run":3,"log_probability":-4.0,"is_stuck":false}"#;
        let stored: Repeats = serde_json::from_str(text).unwrap();
        let runs = Runs {
            last: Some(1.5),
            pairs: 9,
            equal: 1,
            repetitions: 3,
        };
        let expected = Repeats {
            runs,
            step: f64::INFINITY,
            log_probability: -4.0,
            is_stuck: false,
        };
        assert_eq!(stored, expected);
        let mut bytes = Vec::new();
        ciborium::into_writer(&expected, &mut bytes).unwrap();
        assert_eq!(ciborium::from_reader::<Repeats, _>(&bytes[..]).unwrap(), expected);
    }

    #[test]
    fn coarse_and_held_values_are_not_suspect() {
        let coarse: Vec<f64> = (0..60).map(f64::from).collect();
        assert_eq!(found_after(&coarse, 4.0, 1000), None);
        // Every value is written twice.
        let held: Vec<f64> = (0..400).map(|i| (f64::from(i / 2) * 0.7).sin()).collect();
        assert_eq!(found_after(&held, 1.0, 1000), None);
    }
}
