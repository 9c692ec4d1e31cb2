//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a quantizer, channel, design, decoder or bound was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its domain.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An iteration stopped at its limit before its tolerance was met.
    #[error("{algorithm} did not converge in {iterations} iterations: the last change was {change:e}")]
    NotConverged {
        /// Which iteration.
        algorithm: &'static str,
        /// Iterations spent.
        iterations: usize,
        /// Size of the last change, in the units of the stop rule.
        change: f64,
    },
    /// A table would be larger than the caller allows.
    #[error("{table} would need {needed} entries: at most {limit} are allowed")]
    TooLarge {
        /// Which table.
        table: &'static str,
        /// Entries needed, saturated at `u64::MAX`.
        needed: u64,
        /// Entries allowed.
        limit: u64,
    },
    /// The noise of three sensors or more needs more than one shared factor.
    #[error(
        "unsupported correlation: the noise of these {sensors} sensors is not independent noise plus one shared factor"
    )]
    UnsupportedCorrelation {
        /// Number of sensors.
        sensors: usize,
    },
    /// A design drives a cell out of existence: fewer levels serve as well.
    #[error(
        "cell {cell} of quantizer {quantizer} vanishes (its probability falls to {probability:e}): design fewer levels"
    )]
    VanishingCell {
        /// Which quantizer of the system.
        quantizer: usize,
        /// Which of its cells.
        cell: usize,
        /// Its probability when the design stopped.
        probability: f64,
    },
    /// The best cells of a level are not one interval, and a contiguous quantizer was asked for.
    #[error("the best cells are labelled {labels:?}: no contiguous quantizer is a fixed point here")]
    NotContiguous {
        /// Labels of the best cells from left to right.
        labels: Vec<usize>,
    },
    /// Symbols arrived together that cannot do so under the model.
    #[error("these symbols cannot be received together under the model: nothing follows from them")]
    ImpossibleOutcome,
    /// A pattern whose bit is the same in every cell tells nothing.
    #[error("the pattern gives the same bit in all {cells} cells: expected at least one 0 and one 1")]
    ConstantPattern {
        /// Number of cells of the pattern.
        cells: usize,
    },
    /// A pattern and a grid disagree about the number of cells.
    #[error("the pattern has {pattern} bits and the grid {grid} cells: expected as many bits as cells")]
    PatternLength {
        /// Bits of the pattern.
        pattern: usize,
        /// Cells of the grid.
        grid: usize,
    },
    /// Two cells get the same bit from every sensor, so that no decoder can tell them apart.
    #[error(
        "cells {first} and {second} get the same bits from every sensor: expected patterns that separate all cells"
    )]
    NotSeparating {
        /// Index of one cell, from 0.
        first: usize,
        /// Index of the other cell, from 0.
        second: usize,
    },
    /// Masks that do not span all linear patterns where full rank was asked for.
    #[error("{sensors} masks of rank {rank}: expected rank {expected}")]
    RankDeficient {
        /// Number of masks, one a sensor.
        sensors: usize,
        /// Rank over GF(2) that is present, or possible.
        rank: usize,
        /// Rank asked for.
        expected: usize,
    },
    /// A table that would not fit into memory.
    #[error("{outcomes} outcomes: expected at most {limit}")]
    TooManyOutcomes {
        /// Number of distinguishable outcomes, saturated.
        outcomes: u128,
        /// Largest number accepted.
        limit: u128,
    },
    /// A count beyond 128 bits.
    #[error("the number of {what} exceeds 128 bits")]
    CountOverflow {
        /// What was counted.
        what: &'static str,
    },
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
    /// A solver that gave up, or whose answer has no optimality certificate.
    #[error("linear assignment: {0}")]
    Assignment(String),
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

/// Shorthand for an argument error of this crate.
pub(crate) fn refuse<T>(
    name: &'static str,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> Result<T, Error> {
    Err(ArgumentError::new(name, value, expected).into())
}
