//! Errors of the one-bit filters.

/// Errors of this crate. A failed step leaves the old belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core types; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(fewbits_core::Error),
    /// A report that does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A dynamics or sensor model refused its parameters.
    #[error(transparent)]
    Model(fewbits_models::Error),
    /// A filter of `fewbits_filters` failed.
    #[error(transparent)]
    Filter(fewbits_filters::Error),
    /// A quantizer could not be made.
    #[error(transparent)]
    Quantizer(#[from] fewbits_quantizers::Error),
    /// A steady-state equation has no root, or none was found.
    #[error(transparent)]
    Root(#[from] fewbits_numerics::roots::RootError),
    /// The plant coefficient exceeds 1 in size. One bit moves the estimate by at most the gain. An error beyond `gain / (|a| - 1)`
    /// therefore grows without limit, although the computed variance stays finite.
    #[error(
        "the plant coefficient is {coefficient}: expected one in [-1, 1], because a bounded correction cannot hold an \
             unstable plant (`new_unstable` accepts the risk)"
    )]
    UnstablePlant {
        /// The plant coefficient `a`.
        coefficient: f64,
    },
    /// An iteration did not converge within its limit.
    #[error("{what} did not settle within {iterations} iterations")]
    NotConverged {
        /// What was iterated.
        what: &'static str,
        /// Iterations spent.
        iterations: usize,
    },
}

impl Error {
    /// The observation has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

fewbits_numerics::lift!(fewbits_core => Core);
fewbits_numerics::lift!(fewbits_filters with Core => Filter);

impl From<fewbits_models::Error> for Error {
    fn from(error: fewbits_models::Error) -> Self {
        match error {
            fewbits_models::Error::UnstablePlant { coefficient } => Self::UnstablePlant { coefficient },
            fewbits_models::Error::Argument(argument) => Self::Argument(argument),
            other => Self::Model(other),
        }
    }
}

impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        fewbits_filters::Error::from(error).into()
    }
}
