//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a pattern, bank, decoder, search or bound could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An error of the quantizers crate.
    #[error(transparent)]
    Quantizer(fewbits_quantizers::Error),
    /// An iteration reached its limit before it converged.
    #[error("{algorithm} did not converge in {iterations} iterations: the last change was {change:e}")]
    NotConverged {
        /// Name of the iteration.
        algorithm: &'static str,
        /// Number of iterations done.
        iterations: usize,
        /// Size of the last change, in the units of the stopping rule.
        change: f64,
    },
    /// The bit of a pattern is the same in every cell, so it carries no information.
    #[error("the pattern gives the same bit in all {cells} cells: expected at least one 0 and one 1")]
    ConstantPattern {
        /// Number of cells of the pattern.
        cells: usize,
    },
    /// A pattern and a grid have different numbers of cells.
    #[error("the pattern has {pattern} bits and the grid {grid} cells: expected as many bits as cells")]
    PatternLength {
        /// Number of bits of the pattern.
        pattern: usize,
        /// Number of cells of the grid.
        grid: usize,
    },
    /// Two cells get the same bit from every sensor, so that no decoder can distinguish them.
    #[error(
        "cells {first} and {second} get the same bits from every sensor: expected patterns that separate all cells"
    )]
    NotSeparating {
        /// Index of one cell, from 0.
        first: usize,
        /// Index of the other cell, from 0.
        second: usize,
    },
    /// The masks do not span all linear patterns, but full rank was asked for.
    #[error("{sensors} masks of rank {rank}: expected rank {expected}")]
    RankDeficient {
        /// Number of masks, one per sensor.
        sensors: usize,
        /// Rank over GF(2) of the masks, or the largest possible rank.
        rank: usize,
        /// Rank that was asked for.
        expected: usize,
    },
    /// A table would be too large for memory.
    #[error("{outcomes} outcomes: expected at most {limit}")]
    TooManyOutcomes {
        /// Number of outcomes; larger numbers are given as `u128::MAX`.
        outcomes: u128,
        /// Largest number accepted.
        limit: u128,
    },
    /// A count exceeds 128 bits.
    #[error("the number of {what} exceeds 128 bits")]
    CountOverflow {
        /// What was counted.
        what: &'static str,
    },
}

fewbits_numerics::lift!(fewbits_quantizers => Quantizer);

impl From<Error> for fewbits_core::Error {
    /// The core's argument error: in a scheme only arguments can be wrong.
    fn from(error: Error) -> Self {
        match error {
            Error::Argument(argument) => Self::Argument(argument),
            Error::Quantizer(error) => error.into(),
            other => ArgumentError::new("pattern", other, "a usable pattern").into(),
        }
    }
}

/// An error if there are more outcomes than the limit.
pub(crate) fn at_most(outcomes: u128, limit: u128) -> Result<(), Error> {
    if outcomes > limit {
        return Err(Error::TooManyOutcomes { outcomes, limit });
    }
    Ok(())
}
