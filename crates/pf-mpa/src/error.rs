//! What this crate refuses.

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
    Core(fewbits_core::Error),
    /// A message that does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A density that cannot be.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// A filter failed.
    #[error(transparent)]
    Filter(fewbits_filters::Error),
    /// A model refused its parameters.
    #[error(transparent)]
    Model(fewbits_models::Error),
    /// A quantizer refused its parameters.
    #[error(transparent)]
    Quantizer(fewbits_quantizers::Error),
}

impl Error {
    /// What was observed has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

/// Refuses an argument.
pub(crate) fn refuse<T>(
    name: &'static str,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> Result<T, Error> {
    Err(ArgumentError::new(name, value, expected).into())
}

impl From<fewbits_core::Error> for Error {
    fn from(error: fewbits_core::Error) -> Self {
        match error {
            fewbits_core::Error::Argument(error) => Self::Argument(error),
            other => Self::Core(other),
        }
    }
}

impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        match error {
            fewbits_densities::Error::Argument(error) => Self::Argument(error),
            fewbits_densities::Error::Core(error) => error.into(),
            other => Self::Density(other),
        }
    }
}

impl From<fewbits_filters::Error> for Error {
    fn from(error: fewbits_filters::Error) -> Self {
        match error {
            fewbits_filters::Error::Argument(error) => Self::Argument(error),
            fewbits_filters::Error::Core(error) => error.into(),
            fewbits_filters::Error::Density(error) => error.into(),
            other => Self::Filter(other),
        }
    }
}

impl From<fewbits_models::Error> for Error {
    fn from(error: fewbits_models::Error) -> Self {
        match error {
            fewbits_models::Error::Argument(error) => Self::Argument(error),
            other => Self::Model(other),
        }
    }
}

impl From<fewbits_quantizers::Error> for Error {
    fn from(error: fewbits_quantizers::Error) -> Self {
        Self::Quantizer(error)
    }
}
