//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a quantizer, labelling, channel, density or report was not accepted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
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
    /// A design ended at a point that is not a local optimum: a cell is empty, or some change of the breakpoints still lowers the error.
    #[error("{algorithm} ended at no optimum: cell {cell} of {levels} has probability {probability:e}")]
    NotOptimal {
        /// Name of the iteration.
        algorithm: &'static str,
        /// Index of the least probable cell.
        cell: usize,
        /// Number of cells.
        levels: usize,
        /// Probability of that cell.
        probability: f64,
    },
    /// A table would have more entries than allowed.
    #[error("{table} would need {needed} entries: at most {limit} are allowed")]
    TooLarge {
        /// Name of the table.
        table: &'static str,
        /// Number of entries needed; larger numbers are given as `u64::MAX`.
        needed: u64,
        /// Number of entries allowed.
        limit: u64,
    },
}

pub(crate) use fewbits_numerics::error::refuse;

impl From<Error> for fewbits_core::Error {
    /// The core's argument error, or its error for an iteration that did not converge.
    fn from(error: Error) -> Self {
        match error {
            Error::Argument(argument) => Self::Argument(argument),
            Error::NotConverged { iterations, .. } => Self::NotConverged {
                evaluations: iterations,
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
