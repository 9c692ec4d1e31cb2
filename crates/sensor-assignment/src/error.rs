//! The error of this crate.

/// Why a network, cost matrix or assignment was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// The sensors' patterns were refused.
    #[error(transparent)]
    Patterns(fewbits_binary_patterns::Error),
    /// The design of the cells was refused.
    #[error(transparent)]
    Design(fewbits_quantizer_design::Error),
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
        "variances of mean {mean} and standard deviation {deviation} over {count} sensors: expected deviation <= mean sqrt(count - 1)"
    )]
    InfeasibleVariances {
        /// Mean asked for.
        mean: f64,
        /// Population standard deviation asked for.
        deviation: f64,
        /// Number of sensors.
        count: usize,
    },
}

fewbits_numerics::lift!(fewbits_binary_patterns => Patterns, fewbits_quantizer_design => Design);
