//! Errors of this crate.

/// Errors of the search for a source.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core: [`fewbits_core::Error::Impossible`] where no probability is left.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// The physics.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// A belief could not be formed.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// The network.
    #[error(transparent)]
    Topology(#[from] fewbits_topology::Error),
    /// A message could not be written or read.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// The density is too thin for the cells allowed.
    #[error("the density needs {cells} cells or more: expected a density that fewer resolve")]
    Unresolved {
        /// Cells that the next refinement would take.
        cells: usize,
    },
    /// The density has no peak of the shape that an approximation needs.
    #[error("no Gaussian peak: {reason}")]
    NoPeak {
        /// Reason.
        reason: &'static str,
    },
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

fewbits_numerics::lift!(fewbits_densities with Core => Density);
