//! Errors of densities over the source.

use fewbits_numerics::ArgumentError;

/// Why a density over the source could not be formed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An error of the core: [`fewbits_core::Error::Impossible`] where no probability is left.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// Another error of the densities below.
    #[error(transparent)]
    Density(fewbits_densities::Error),
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
}

fewbits_numerics::lift!(fewbits_densities with Core => Density);
