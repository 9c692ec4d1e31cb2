//! Errors of this crate.

use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What the search for a source refuses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The physics.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// A belief could not be formed.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
    /// The network.
    #[error(transparent)]
    Topology(#[from] fewbits_topology::Error),
    /// A message could not be written or read.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// No instant of sampling lies after the start of the release.
    #[error("no instant of sampling lies after the release began at {start}: expected at least one")]
    NothingReleased {
        /// Start of the release, s.
        start: f64,
    },
}
