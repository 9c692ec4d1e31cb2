//! What a filter refuses, and what can go wrong with a belief.

fewbits_numerics::errors! {
    /// Errors of this crate. A failed step leaves the old belief as it was.
    pub enum Error wraps {
        /// What a word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
        Core(#[from] fewbits_core::Error),
        /// A model refused its parameters.
        Model(#[from] fewbits_models::Error),
        /// A message that does not fit its format.
        Codec(#[from] fewbits_core::CodecError),
        /// A density that cannot be.
        Density(fewbits_densities::Error),
    } and {
        /// The innovation covariance has no Cholesky factor.
        #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
        SingularInnovation,
        /// The Riccati recursion has no finite limit.
        #[error("the error variance has no finite steady state: an unstable part of the state is not observed well enough")]
        NoSteadyState,
    }
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
