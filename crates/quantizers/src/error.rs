//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a quantizer, labelling, channel, density or report was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
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
    /// A design ended where the error is not least: a cell is empty, or some change of the breakpoints still lowers the error.
    #[error("{algorithm} ended at no optimum: cell {cell} of {levels} has probability {probability:e}")]
    NotOptimal {
        /// Which iteration.
        algorithm: &'static str,
        /// The least probable cell.
        cell: usize,
        /// Number of cells.
        levels: usize,
        /// Probability of that cell.
        probability: f64,
    },
    /// A table would be larger than allowed.
    #[error("{table} would need {needed} entries: at most {limit} are allowed")]
    TooLarge {
        /// Which table.
        table: &'static str,
        /// Entries needed, saturated at `u64::MAX`.
        needed: u64,
        /// Entries allowed.
        limit: u64,
    },
}

pub(crate) use fewbits_numerics::error::refuse;

impl From<Error> for fewbits_core::Error {
    /// What a scheme reports: the argument, or that nothing converged.
    fn from(error: Error) -> Self {
        match error {
            Error::Argument(argument) => Self::Argument(argument),
            Error::NotConverged {
                algorithm, iterations, ..
            } => Self::NotConverged {
                what: algorithm,
                steps: iterations,
                unit: "iterations",
            },
            Error::NotOptimal { cell, levels, .. } => ArgumentError::new(
                "levels",
                levels,
                format!("a number of levels that leaves cell {cell} something to hold"),
            )
            .into(),
            Error::TooLarge { table, needed, limit } => {
                ArgumentError::new("table", format!("{table} of {needed} entries"), format!("at most {limit}")).into()
            }
        }
    }
}
