//! Errors of this crate.

/// Errors of this crate. A failed step leaves the belief unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// A message does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A density could not be created.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// The innovation covariance has no Cholesky factor.
    #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
    SingularInnovation,
    /// The grid has too few nodes for the posterior, which has too thin a ridge or too many modes.
    #[error("the grid has {nodes_per_deviation:.2} nodes per deviation of the posterior: expected at least 1.5")]
    Unresolved {
        /// Nodes per standard deviation along the principal axis that has the fewest.
        nodes_per_deviation: f64,
    },
    /// No sensor of this number has joined the centre.
    #[error("sensor {sensor} has not joined: {seated} sensors have")]
    UnknownSensor {
        /// The number that was given.
        sensor: u32,
        /// How many sensors have joined.
        seated: usize,
    },
    /// The Riccati recursion has no finite limit.
    #[error("the error variance has no finite steady state: an unstable part of the state is not observed well enough")]
    NoSteadyState,
}

impl Error {
    /// The observation has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

// The same error for the same cause, in whichever crate it was found.
fewbits_numerics::lift!(fewbits_densities with Core => Density);
