//! Errors of the range trackers.

/// Errors of this crate. After a failed step the belief is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core types; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(fewbits_core::Error),
    /// A message that does not fit its format.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A filter or a density failed.
    #[error(transparent)]
    Filter(fewbits_filters::Error),
    /// A model refused its parameters.
    #[error(transparent)]
    Model(fewbits_models::Error),
    /// A quantizer refused its parameters.
    #[error(transparent)]
    Quantizer(#[from] fewbits_quantizers::Error),
}

impl Error {
    /// The observation has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

pub(crate) use fewbits_numerics::error::refuse;

fewbits_numerics::lift!(fewbits_core => Core, fewbits_models => Model);
fewbits_numerics::lift!(fewbits_filters with Core => Filter);

impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        fewbits_filters::Error::from(error).into()
    }
}
