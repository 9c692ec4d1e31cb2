//! Kalman, particle and exact grid filters that hear any message through its likelihood.

mod error;
mod guided;
mod particle;
mod resample;

pub use error::Error;
pub use guided::OptimalProposal;
pub use particle::{ParticleFilter, ParticleInfo, Proposal, Workspace};
pub use resample::{Resampling, Schedule};
