//! The alternative hypothesis that a rejected report is right and the prediction is not: the level has jumped.
//!
//! ```text
//! begins with a report that is rejected, or of a sensor whose test raises an alarm, from a prediction wide enough for it;
//!     its belief is predicted and updated as the belief is
//! log ratio = sum over the reports of the other sensors from then on:  ln p(report | alternative) - ln p(report | belief)
//! log ratio >= 4.6 = ln 100:  its belief becomes the belief;  also above 1 after 12 reports of the sensor in a row that were rejected
//! log ratio <= -3:            the sensor with which it began may be excluded
//! ends when a report of that sensor agrees with the belief, or the sensor is excluded or dead
//! ```
//! Each probability is measured from that of the likeliest report. Reports whose noise is much larger than the prediction's deviation add
//! little.

use crate::Error;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_numerics::error::{finite, refuse};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Log ratio, in nats, from which the alternative is accepted: wrongly for at most one wrong sensor in 100.
pub(super) const DECISIVE: f64 = 4.6;
/// Log ratio, in nats, up to which the sensor with which it began may be excluded: one right sensor in 20 comes as low at some instant.
const AGAINST: f64 = -3.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Alternative<const D: usize> {
    /// Number of the sensor with whose report it began.
    pub sensor: u32,
    pub belief: Gaussian<D>,
    pub log_ratio: f64,
}

impl<const D: usize> Alternative<D> {
    pub(crate) fn is_believed(&self) -> bool {
        self.log_ratio >= DECISIVE
    }

    pub(crate) fn moved(self, dynamics: &dyn GaussianDynamics<D>, noise_scale: f64) -> Option<Self> {
        let belief = dynamics.predict(&self.belief, noise_scale);
        belief.is_finite().then_some(Self { belief, ..self })
    }

    /// Whether the reports of the others contradict the sensor with which it began; `None` if it began with another.
    pub(crate) fn is_against(&self, sensor: u32) -> Option<bool> {
        (self.sensor == sensor).then_some(self.log_ratio <= AGAINST)
    }
}

/// An alternative as it is stored: the covariance column by column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredAlternative {
    sensor: u32,
    log_ratio: f64,
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

impl<const D: usize> From<&Alternative<D>> for StoredAlternative {
    fn from(alternative: &Alternative<D>) -> Self {
        Self {
            sensor: alternative.sensor,
            log_ratio: alternative.log_ratio,
            mean: alternative.belief.mean().as_slice().to_vec(),
            covariance: alternative.belief.covariance().as_slice().to_vec(),
        }
    }
}

impl StoredAlternative {
    pub(crate) fn read<const D: usize>(&self) -> Result<Alternative<D>, Error> {
        if (self.mean.len(), self.covariance.len()) != (D, D * D) {
            return refuse("alternative", format!("{} coordinates", self.mean.len()), format!("{D}"));
        }
        let mean = SVector::from_column_slice(&self.mean);
        let covariance = SMatrix::from_column_slice(&self.covariance);
        Ok(Alternative {
            sensor: self.sensor,
            belief: Gaussian::new(mean, covariance)?,
            log_ratio: finite("log_ratio", self.log_ratio)?,
        })
    }
}
