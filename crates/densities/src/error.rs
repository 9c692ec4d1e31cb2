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
    /// A density is zero wherever it was looked for: the observation and the belief exclude each other.
    #[error("the density vanishes on all of its support: the largest log density is {largest}, expected a finite number")]
    BeliefMiss {
        /// The largest log density found.
        largest: f64,
    },
    /// A density is too thin for the cells allowed.
    #[error("the density needs {cells} cells or more: expected a density that fewer resolve")]
    Unresolved {
        /// Cells that the next refinement would take.
        cells: usize,
    },
    /// A density has no peak of the shape that an approximation needs.
    #[error("no Gaussian peak: {reason}")]
    NoPeak {
        /// What is wrong with the place where the search ended.
        reason: &'static str,
    },
}
