//! The belief that is right if a rejected report is, and the prediction is not: the level has jumped.
//!
//! ```text
//! begins with a report that is rejected, or of a sensor whose test raises an alarm, from a prediction wide enough for it;
//!     is predicted and updated as the belief is
//! votes = sum over reports of the other sensors from then on:  ln p(report | rival) - ln p(report | belief)
//! votes >= ln 100:  the belief is replaced by the rival
//! votes <= -3:      the sensor with which it began may be excluded
//! ends when a report of that sensor agrees with the belief, or the sensor is excluded or dead
//! ```
//! Each probability is measured from that of the likeliest report. A sensor that is much less accurate than the prediction says little,
//! whatever it reports.

use crate::Error;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_numerics::error::{finite, refuse};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Votes at which the rival is believed: one wrong sensor in 100 is.
pub(super) const DECISIVE: f64 = 4.6;
/// Votes at which the sensor with which it began may be excluded: one right sensor in 20 has as few at some instant.
const AGAINST: f64 = -3.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rival<const D: usize> {
    /// Number of the sensor with whose report it began.
    pub sensor: u32,
    pub belief: Gaussian<D>,
    pub votes: f64,
}

impl<const D: usize> Rival<D> {
    pub(crate) fn is_believed(&self) -> bool {
        self.votes >= DECISIVE
    }

    pub(crate) fn moved(self, dynamics: &dyn GaussianDynamics<D>, noise_scale: f64) -> Option<Self> {
        let belief = dynamics.predict(&self.belief, noise_scale);
        belief.is_finite().then_some(Self { belief, ..self })
    }

    /// Whether the others have spoken against the sensor with which it began; `None` if it began with another.
    pub(crate) fn is_against(&self, sensor: u32) -> Option<bool> {
        (self.sensor == sensor).then_some(self.votes <= AGAINST)
    }
}

/// A rival as it is stored: the covariance column by column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredRival {
    sensor: u32,
    votes: f64,
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

impl<const D: usize> From<&Rival<D>> for StoredRival {
    fn from(rival: &Rival<D>) -> Self {
        Self {
            sensor: rival.sensor,
            votes: rival.votes,
            mean: rival.belief.mean().as_slice().to_vec(),
            covariance: rival.belief.covariance().as_slice().to_vec(),
        }
    }
}

impl StoredRival {
    pub(crate) fn read<const D: usize>(&self) -> Result<Rival<D>, Error> {
        if (self.mean.len(), self.covariance.len()) != (D, D * D) {
            return refuse("rival", format!("{} coordinates", self.mean.len()), format!("{D}"));
        }
        let mean = SVector::from_column_slice(&self.mean);
        let covariance = SMatrix::from_column_slice(&self.covariance);
        Ok(Rival {
            sensor: self.sensor,
            belief: Gaussian::new(mean, covariance)?,
            votes: finite("votes", self.votes)?,
        })
    }
}
