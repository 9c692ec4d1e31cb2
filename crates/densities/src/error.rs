//! Errors of this crate.

use fewbits_core::CodecError;
use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What a density refuses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A belief that does not fit its wire format, or bits that are no belief.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// No particle has any weight left, or a weight is not a number.
    #[error("degenerate particles: the largest log weight is {largest}, expected a finite number")]
    Degenerate {
        /// The largest log weight found.
        largest: f64,
    },
}
