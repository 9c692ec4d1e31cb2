//! What this crate refuses.

/// Errors of this crate. A failed step leaves the old belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// What a word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
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
    /// What was observed has probability zero under the belief.
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
