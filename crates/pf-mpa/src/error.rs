//! What this crate refuses.

fewbits_numerics::errors! {
    /// Errors of this crate. A failed step leaves the old belief as it was.
    pub enum Error wraps {
        /// What a word of the core refused; [`fewbits_core::Error::Impossible`] for an observation of probability zero.
        Core(fewbits_core::Error),
        /// A message that does not fit its format.
        Codec(#[from] fewbits_core::CodecError),
        /// A density that cannot be.
        Density(fewbits_densities::Error),
        /// A filter failed.
        Filter(fewbits_filters::Error),
        /// A model refused its parameters.
        Model(fewbits_models::Error),
        /// A quantizer refused its parameters.
        Quantizer(fewbits_quantizers::Error),
    } and {}
}

impl Error {
    /// What was observed has probability zero under the belief.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

pub(crate) use fewbits_numerics::error::refuse;

fewbits_numerics::lift!(fewbits_core => Core, fewbits_models => Model);

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

impl From<fewbits_quantizers::Error> for Error {
    fn from(error: fewbits_quantizers::Error) -> Self {
        Self::Quantizer(error)
    }
}
