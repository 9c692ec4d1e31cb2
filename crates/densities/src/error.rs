//! Errors of this crate.

use fewbits_numerics::ArgumentError;

/// Why a density could not be created or changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An error of the core; [`fewbits_core::Error::Impossible`] if no probability is left.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
}
