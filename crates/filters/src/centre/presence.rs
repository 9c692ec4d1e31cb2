//! Whether a silent sensor still works.
//!
//! ```text
//! w            probability to work before the slot; over dt seconds  w <- w exp(-failure_rate dt)
//! silence      w <- w E / (w E + 1 - w),   E = p(nothing arrives | works) under the belief without this observation
//! a report     w <- 1
//! R            (1 + R) / E after silence, 0 after a report: the Shiryaev-Roberts statistic
//! named dead   when R reaches 1 / (rate of false alarms)
//! ```
//! `R` minus the number of slots is a martingale while the sensor works, so that a working sensor is named dead less than once in
//! `1 / rate` slots on average (Pollak 1985), whatever the scheme, the threshold and the loss.
//!
//! Not covered: sensors that die because of the state (the target destroys them), or together.

use crate::Error;
use fewbits_numerics::error::{non_negative, within};
use serde::{Deserialize, Serialize};

/// What is supposed of failures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failures {
    /// Failures of a working sensor per second.
    pub rate: f64,
    /// How often a working sensor may be named dead, per slot.
    pub false_alarms: f64,
}

impl Default for Failures {
    /// One failure in 10^4 seconds, one working sensor named dead in 10^4 slots.
    fn default() -> Self {
        Self {
            rate: 1e-4,
            false_alarms: 1e-4,
        }
    }
}

impl Failures {
    pub(super) fn check(&self) -> Result<(), Error> {
        non_negative("rate", self.rate)?;
        within("false_alarms", self.false_alarms, 1e-12, 0.1)?;
        Ok(())
    }
}

/// What is known of one sensor's presence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Presence {
    #[serde(with = "fewbits_numerics::stored")]
    pub working: f64,
    #[serde(with = "fewbits_numerics::stored")]
    statistic: f64,
    pub named_dead: bool,
}

impl Presence {
    pub fn new() -> Self {
        Self {
            working: 1.0,
            statistic: 0.0,
            named_dead: false,
        }
    }

    pub fn advance(&mut self, seconds: f64, failures: &Failures) {
        self.working *= (-failures.rate * seconds).exp();
    }

    /// Nothing arrived, which has probability `silence` if the sensor works. Whether the sensor is named dead now.
    pub fn silent(&mut self, silence: f64, failures: &Failures) -> bool {
        let alive = self.working * silence;
        let total = alive + 1.0 - self.working;
        // Certain to work and certain to report: silence is impossible, and the failure has happened all the same.
        self.working = if total > 0.0 { alive / total } else { 0.0 };
        self.statistic = (1.0 + self.statistic) / silence.max(f64::MIN_POSITIVE);
        let dead = self.statistic * failures.false_alarms >= 1.0;
        let news = dead && !self.named_dead;
        self.named_dead |= dead;
        news
    }

    /// A report arrived. Whether the sensor had been named dead.
    pub fn heard(&mut self) -> bool {
        let news = self.named_dead;
        *self = Self::new();
        news
    }
}
