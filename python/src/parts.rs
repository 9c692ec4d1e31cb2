//! A fusion centre as plain data.

use crate::error::{Outcome, refused};
use crate::model::Model;
use crate::seat::Seat;
use crate::table::Origin;
use fewbits_filters::centre::Health;
use serde::{Deserialize, Serialize};

/// What is done with the results of the centre's tests.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(crate) enum Tests {
    Off,
    Report,
    Exclude,
}

impl Tests {
    pub(crate) fn parsed(text: &str) -> Outcome<Self> {
        match text {
            "off" => Ok(Self::Off),
            "report" => Ok(Self::Report),
            "exclude" => Ok(Self::Exclude),
            other => refused("health", format!("'{other}'"), "'off', 'report' or 'exclude'"),
        }
    }

    pub(crate) fn health(self) -> Health {
        match self {
            Self::Off => Health::Off,
            Self::Report => Health::Report,
            Self::Exclude => Health::Exclude,
        }
    }
}

/// Settings, sensors and state: all that a centre is.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Parts {
    pub(crate) model: Model,
    pub(crate) mean: Vec<f64>,
    /// By columns.
    pub(crate) covariance: Vec<f64>,
    pub(crate) learn_noise: bool,
    pub(crate) tests: Tests,
    pub(crate) failures: f64,
    pub(crate) window: f64,
    pub(crate) seats: Vec<Seat>,
    pub(crate) origin: Option<Origin>,
    /// The stored state of the library's centre.
    pub(crate) state: Option<Vec<u8>>,
}
