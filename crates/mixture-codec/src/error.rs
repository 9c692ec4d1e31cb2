//! Errors of this crate.

use fewbits_core::CodecError;
use fewbits_numerics::ArgumentError;

/// Why a mixture could not be reduced, compared, encoded or decoded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An error of the core; [`fewbits_core::Error::Impossible`] if no probability is left.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
    /// A mixture does not fit its wire format, or bits are not an encoded mixture.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// Another error of the densities.
    #[error(transparent)]
    Density(fewbits_densities::Error),
}

fewbits_numerics::lift!(fewbits_densities with Core => Density);
