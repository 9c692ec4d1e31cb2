//! Errors of the adaptive codec.

/// Errors of this crate. After a failed call sensor and receiver are unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A packet or stream that no sensor of this configuration can have sent.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// An error of the core types; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// A filter failed.
    #[error(transparent)]
    Filter(#[from] fewbits_filters::Error),
    /// A model was refused.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
}

impl From<fewbits_node::Error> for Error {
    fn from(error: fewbits_node::Error) -> Self {
        Self::Argument(error.into())
    }
}
