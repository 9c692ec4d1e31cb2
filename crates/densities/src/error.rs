//! Errors of this crate.

use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What a density refuses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// What a word of the core refused; [`fewbits_core::Error::Impossible`] where no probability is left.
    #[error(transparent)]
    Core(#[from] fewbits_core::Error),
}

impl Error {
    /// No probability is left.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}
