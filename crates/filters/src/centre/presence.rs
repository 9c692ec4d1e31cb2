//! The probability that a silent sensor still works.
//!
//! ```text
//! alone        probability that the sensor works if sensors fail one by one; over dt seconds  alone <- alone exp(-rate dt)
//! struck       the same if a common failure has occurred, in which each sensor fails with probability 1/2
//! b            probability of a common failure; over dt seconds  b <- b + (1 - b) (1 - exp(-rate dt))
//! silence      w <- w E / (w E + 1 - w) for both,   E = p(nothing arrives | works) under the belief without this observation
//! a report     alone, struck <- 1
//! b's odds     times the product over the sensors of p(observed | struck) / p(observed | alone)
//! working      (1 - b) alone + b struck
//! R            (1 + R) / E after silence, 0 after a report: the Shiryaev-Roberts statistic
//! named dead   when R reaches 1 / (rate of false alarms): the sensor is declared dead
//! ```
//! `R` minus the number of slots is a martingale while the sensor works. A working sensor is therefore declared dead less than once in
//! `1 / rate` slots on average (Pollak 1985), for every scheme, threshold and loss.
//!
//! Common failures are modelled because sensors that die together would otherwise be doubted one by one, and their silence would be used as
//! information for a long time. Not modelled: sensors that die because of the state (for instance, destroyed by the target).

use crate::Error;
use fewbits_numerics::error::{non_negative, within};
use serde::{Deserialize, Serialize};

/// Assumed rates of failures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failures {
    /// Rate of failures of a working sensor, per second. Common failures, each of half of the sensors, have the same rate.
    pub rate: f64,
    /// Largest rate, per slot, at which working sensors are declared dead.
    pub false_alarms: f64,
}

impl Default for Failures {
    /// One failure in 10^4 seconds; one working sensor declared dead in 10^4 slots.
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

/// State of the test of one sensor's presence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Presence {
    pub working: f64,
    alone: f64,
    struck: f64,
    #[serde(with = "fewbits_numerics::stored")]
    statistic: f64,
    pub named_dead: bool,
}

impl Presence {
    pub(crate) fn new() -> Self {
        Self {
            working: 1.0,
            alone: 1.0,
            struck: 1.0,
            statistic: 0.0,
            named_dead: false,
        }
    }

    /// Updates after nothing arrived, which has probability `silence` if the sensor works. Returns `ln` of the likelihood ratio of a common
    /// failure against none, and whether the sensor is declared dead now.
    pub(crate) fn silent(&mut self, silence: f64, failures: &Failures) -> (f64, bool) {
        let evidence = |works: &mut f64| {
            let alive = *works * silence;
            let total = alive + 1.0 - *works;
            // If the sensor certainly worked and would certainly have reported, silence has probability zero. The failure is then taken as
            // certain.
            *works = if total > 0.0 { alive / total } else { 0.0 };
            total.max(f64::MIN_POSITIVE)
        };
        let ratio = (evidence(&mut self.struck) / evidence(&mut self.alone)).ln();
        self.statistic = (1.0 + self.statistic) / silence.max(f64::MIN_POSITIVE);
        let dead = self.statistic * failures.false_alarms >= 1.0;
        let news = dead && !self.named_dead;
        self.named_dead |= dead;
        (ratio, news)
    }

    /// Logarithm of the probability that the sensor works.
    pub(crate) fn log_working(&self) -> f64 {
        if self.working == 1.0 {
            return 0.0;
        }
        self.working.max(f64::MIN_POSITIVE).ln()
    }

    /// Updates after a report arrived. Returns `ln` of the likelihood ratio of a common failure against none, and whether the sensor had
    /// been declared dead.
    pub(crate) fn report_arrived(&mut self) -> (f64, bool) {
        let ratio = self.struck.max(f64::MIN_POSITIVE) / self.alone.max(f64::MIN_POSITIVE);
        let ratio = if ratio == 1.0 { 0.0 } else { ratio.ln() };
        let news = self.named_dead;
        *self = Self::new();
        (ratio, news)
    }
}

/// Probability that a common failure destroys a given sensor.
const TAKEN: f64 = 0.5;
/// The smallest probability of a common failure: log odds of -700.
const LOWEST: f64 = 9.859_676_543_759_77e-305;
/// Above this probability a common failure is treated as certain, and the next one can occur.
const SETTLED: f64 = 0.999;

/// The probability that a common failure has struck.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Outage(f64);

/// `working`, if a common failure has this probability. Rounding must not leave it above one.
fn mixed(common: f64, sensor: &Presence) -> f64 {
    ((1.0 - common) * sensor.alone + common * sensor.struck).min(1.0)
}

impl Outage {
    pub(crate) fn advance<'a>(
        &mut self,
        seconds: f64,
        failures: &Failures,
        sensors: impl Iterator<Item = &'a mut Presence>,
    ) {
        let survives = if failures.rate == 0.0 {
            1.0
        } else {
            (-failures.rate * seconds).exp()
        };
        let new = (1.0 - self.0) * (1.0 - survives);
        let total = self.0 + new;
        for sensor in sensors {
            // A common failure of this interval finds the sensor as it was alone, and destroys it with probability `TAKEN`.
            if total > 0.0 {
                sensor.struck = (self.0 * survives * sensor.struck + new * (1.0 - TAKEN) * sensor.alone) / total;
            }
            sensor.alone *= survives;
            sensor.working = mixed(total, sensor);
        }
        self.0 = total;
    }

    /// Updates with the sum of the log likelihood ratios of all sensors of one instant.
    pub(crate) fn weigh<'a>(&mut self, log_ratio: f64, sensors: impl Iterator<Item = &'a mut Presence>) {
        // The log odds are limited so that the probability differs from 0 and 1.
        if !(self.0 == LOWEST && log_ratio <= 0.0) {
            let odds = ((self.0 / (1.0 - self.0)).ln() + log_ratio).clamp(-700.0, 700.0).exp();
            self.0 = odds / (1.0 + odds);
        }
        // A certain common failure becomes part of each sensor's own probability, and the next one can be found.
        let settled = self.0 > SETTLED;
        for sensor in sensors {
            sensor.working = mixed(self.0, sensor);
            if settled {
                sensor.alone = sensor.working;
            }
        }
        if settled {
            self.0 = 0.0;
        }
    }
}
