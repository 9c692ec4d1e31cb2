//! The innovation covariances of the published rules.

use serde::{Deserialize, Serialize};

/// Which innovation covariance `S` a sensor weighs its innovation with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighing {
    /// That of the sensor's own Kalman filter, which uses all its measurements (the paper's CFwMD). It needs no covariance
    /// feedback and no data, but the rate of messages differs from the budget by up to a quarter.
    #[default]
    OwnFilter,
    /// `R + H P H'` with the fusion centre's predicted covariance (the paper's CFwMD2). The rate meets the budget, but every broadcast
    /// contains a covariance.
    FusionCentre,
    /// `R + H P H'` with a sequence of expected covariances at the fusion centre, computed before deployment. The rate meets the budget
    /// without covariance feedback, and the error is that of [`FusionCentre`](Self::FusionCentre).
    Scheduled,
}
