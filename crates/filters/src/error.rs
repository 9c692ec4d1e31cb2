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
    /// A message that does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A density that cannot be.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// The innovation covariance has no Cholesky factor.
    #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
    SingularInnovation,
    /// The Riccati recursion has no finite limit.
    #[error("the error variance has no finite steady state: an unstable part of the state is not observed well enough")]
    NoSteadyState,
}

impl Error {
    /// What was observed has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

/// One name for one thing, whichever floor finds it.
impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        match error {
            fewbits_densities::Error::Argument(error) => Self::Argument(error),
            fewbits_densities::Error::Core(error) => Self::Core(error),
            other => Self::Density(other),
        }
    }
}
