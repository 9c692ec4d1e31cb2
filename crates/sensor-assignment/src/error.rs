//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a network, cost matrix or assignment was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its domain.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The sensors' patterns were refused.
    #[error(transparent)]
    Patterns(fewbits_binary_patterns::Error),
    /// A cost matrix that is not square.
    #[error("the cost matrix has {entries} entries: expected {size} x {size}")]
    NotSquare {
        /// Entries given.
        entries: usize,
        /// Rows expected.
        size: usize,
    },
    /// An assignment that does not use each sensor once.
    #[error("the assignment {given:?} is not a permutation of 0..{size}")]
    NotAPermutation {
        /// The offending assignment.
        given: Vec<usize>,
        /// Its expected length.
        size: usize,
    },
    /// No vector of positive variances has this mean and standard deviation.
    #[error(
        "variances of mean {mean} and standard deviation {std} over {count} sensors: expected std <= mean sqrt(count - 1)"
    )]
    InfeasibleVariances {
        /// Mean asked for.
        mean: f64,
        /// Population standard deviation asked for.
        std: f64,
        /// Number of sensors.
        count: usize,
    },
}

impl From<fewbits_binary_patterns::Error> for Error {
    fn from(error: fewbits_binary_patterns::Error) -> Self {
        match error {
            fewbits_binary_patterns::Error::Argument(argument) => Self::Argument(argument),
            other => Self::Patterns(other),
        }
    }
}
