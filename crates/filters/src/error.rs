//! What a filter refuses, and what can go wrong with a belief.

use fewbits_numerics::ArgumentError;

/// Errors of this crate. A failed step leaves the old belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// What a word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// A model refused its parameters.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// A particle belief that cannot be, most often because what was heard is impossible for every particle.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
    /// The innovation covariance has no Cholesky factor.
    #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
    SingularInnovation,
    /// The Riccati recursion has no finite limit.
    #[error("the error variance has no finite steady state: an unstable part of the state is not observed well enough")]
    NoSteadyState,
    /// What was heard has probability zero under the belief.
    #[error("what was heard is impossible under the belief")]
    Impossible,
}
