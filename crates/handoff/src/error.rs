//! Errors of this crate.

use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What a hand-over refuses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The belief refused: no particle agrees with the measurement, or it does not fit its format.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
}
