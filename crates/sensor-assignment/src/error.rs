//! The error of this crate.

/// Why a network, cost matrix or assignment was not accepted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the binary-patterns crate.
    #[error(transparent)]
    Patterns(fewbits_binary_patterns::Error),
    /// An error of the quantizer-design crate.
    #[error(transparent)]
    Design(fewbits_quantizer_design::Error),
    /// A cost matrix is not square.
    #[error("the cost matrix has {entries} entries: expected {size} x {size}")]
    NotSquare {
        /// Number of entries that were given.
        entries: usize,
        /// Number of rows that was expected.
        size: usize,
    },
    /// An assignment does not use each sensor once.
    #[error("the assignment {given:?} is not a permutation of 0..{size}")]
    NotAPermutation {
        /// The assignment that was given.
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
