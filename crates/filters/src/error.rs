//! What a filter refuses, and what can go wrong with a belief.

/// Errors of this crate. A failed step leaves the old belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// What a word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// A message that does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A density refused its parameters.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// The innovation covariance has no Cholesky factor.
    #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
    SingularInnovation,
    /// A grid has too few nodes for the posterior: it is a ridge too thin, or of too many modes, to follow.
    #[error("the grid has {nodes_per_deviation:.2} nodes per deviation of the posterior: expected at least 1.5")]
    Unresolved {
        /// Nodes per deviation along the principal axis that has fewest.
        nodes_per_deviation: f64,
    },
    /// No sensor of this number has joined the centre.
    #[error("sensor {sensor} has not joined: {seated} sensors have")]
    UnknownSensor {
        /// The number.
        sensor: u32,
        /// How many sensors there are.
        seated: usize,
    },
    /// The Riccati recursion has no finite limit.
    #[error("the error variance has no finite steady state: an unstable part of the state is not observed well enough")]
    NoSteadyState,
}

impl Error {
    /// What was observed has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

// One name for one thing, whichever floor finds it.
fewbits_numerics::lift!(fewbits_densities with Core => Density);
