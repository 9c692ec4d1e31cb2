//! Errors of this crate.

fewbits_numerics::errors! {
    /// Errors of the search for a source.
    pub enum Error wraps {
        /// The physics.
        Model(#[from] fewbits_models::Error),
        /// A belief could not be formed.
        Density(#[from] crate::density::Error),
        /// The network.
        Topology(#[from] fewbits_topology::Error),
        /// A message could not be written or read.
        Codec(#[from] fewbits_core::CodecError),
    } and {
        /// No instant of sampling lies after the start of the release.
        #[error("no instant of sampling lies after the release began at {start}: expected at least one")]
        NothingReleased {
            /// Start of the release, s.
            start: f64,
        },
        /// The diffusivity was to be unknown, but the model has not one diffusivity.
        #[error("the model has not one diffusivity that could change: expected a model with `diffusivity_slope`")]
        NoDiffusivity,
        /// Concentrations were asked for everywhere along a ray, but the model has them only at its receptors.
        #[error("the model changes along the ground: expected one that is homogeneous")]
        NotHomogeneous,
    }
}

impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        Self::Density(error.into())
    }
}
