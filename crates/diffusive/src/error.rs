//! Errors of the search for a source.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core types; [`fewbits_core::Error::Impossible`] if all states have probability zero.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// The model of the medium refused its arguments.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// A belief could not be formed.
    #[error(transparent)]
    Density(fewbits_densities::Error),
    /// Deployment or graph refused its arguments.
    #[error(transparent)]
    Topology(#[from] fewbits_topology::Error),
    /// A message could not be written or read.
    #[error(transparent)]
    Codec(#[from] fewbits_core::CodecError),
    /// The density is too thin for the allowed number of cells.
    #[error("the density needs {cells} cells or more: expected a density that fewer resolve")]
    Unresolved {
        /// Cells that the next refinement would need.
        cells: usize,
    },
    /// The density has no peak of the shape that an approximation needs.
    #[error("no Gaussian peak: {reason}")]
    NoPeak {
        /// Reason.
        reason: &'static str,
    },
    /// No sampling instant is after the start of the release.
    #[error("no instant of sampling lies after the release began at {start}: expected at least one")]
    NothingReleased {
        /// Start of the release, s.
        start: f64,
    },
    /// The diffusivity is unknown, but the model has not a single diffusivity.
    #[error("the model has not one diffusivity that could change: expected a model with `diffusivity_slope`")]
    NoDiffusivity,
    /// Concentrations are needed everywhere along a ray, but the model has them only at its receptors.
    #[error("the model changes along the ground: expected one that is homogeneous")]
    NotHomogeneous,
}

fewbits_numerics::lift!(fewbits_densities with Core => Density);
