//! The library's estimators, each as an [`Estimator`](crate::Estimator) or [`Walker`](crate::Walker).

#[cfg(feature = "adaptive")]
mod adaptive;
#[cfg(feature = "cfwmd")]
mod censoring;
#[cfg(feature = "diffusive")]
mod diffusive;
#[cfg(feature = "dymbo")]
mod dymbo;
#[cfg(feature = "handoff")]
mod handoff;
#[cfg(feature = "look-up")]
mod look_up;
mod scheme;
#[cfg(feature = "cfwmd")]
mod send_all;

#[cfg(feature = "adaptive")]
pub use adaptive::{Followed, Followers};
#[cfg(feature = "cfwmd")]
pub use censoring::{Broadcast, CensoringEstimator};
#[cfg(feature = "diffusive")]
pub use diffusive::SourceChain;
#[cfg(feature = "dymbo")]
pub use dymbo::{DymboEstimator, ParallelDymboEstimator};
#[cfg(feature = "handoff")]
pub use handoff::Leaders;
#[cfg(feature = "look-up")]
pub use look_up::{LookUp, Patterns};
pub use scheme::Reporting;
#[cfg(feature = "cfwmd")]
pub use send_all::SendAll;
