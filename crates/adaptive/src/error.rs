//! What this crate refuses.

/// Errors of this crate. A failed call leaves sensor and receiver as they were.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A packet or stream that the scheme cannot have sent.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// A word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
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
