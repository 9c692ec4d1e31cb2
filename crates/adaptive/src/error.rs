//! What this crate refuses.

fewbits_numerics::errors! {
    /// Errors of this crate. A failed call leaves sensor and receiver as they were.
    pub enum Error wraps {
        /// A packet or stream that the scheme cannot have sent.
        Codec(#[from] fewbits_core::CodecError),
        /// A word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
        Core(#[from] fewbits_core::Error),
        /// A filter failed.
        Filter(#[from] fewbits_filters::Error),
        /// A model was refused.
        Model(#[from] fewbits_models::Error),
    } and {}
}

impl From<fewbits_node::Error> for Error {
    fn from(error: fewbits_node::Error) -> Self {
        Self::Argument(error.into())
    }
}
