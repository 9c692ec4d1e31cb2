//! Errors of this crate.

use fewbits_core::ArgumentError;
use thiserror::Error;

/// What a filter refuses, or finds impossible.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A belief that cannot be: all weights zero, most often because what was heard is impossible under the belief.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
}
