//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a pattern, bank, decoder, search or bound was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A Lloyd-Max quantizer was refused.
    #[error(transparent)]
    Quantizer(fewbits_quantizers::Error),
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
}

fewbits_numerics::lift!(fewbits_quantizers => Quantizer);

impl From<Error> for fewbits_core::Error {
    /// What a scheme reports; only arguments can be at fault there.
    fn from(error: Error) -> Self {
        match error {
            Error::Argument(argument) => Self::Argument(argument),
            Error::Quantizer(error) => error.into(),
            other => ArgumentError::new("pattern", other, "a usable pattern").into(),
        }
    }
}

/// Accepts so many outcomes up to a limit.
pub(crate) fn at_most(outcomes: u128, limit: u128) -> Result<(), Error> {
    if outcomes > limit {
        return Err(Error::TooManyOutcomes { outcomes, limit });
    }
    Ok(())
}
