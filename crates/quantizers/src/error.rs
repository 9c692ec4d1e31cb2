//! The error of quantizers and their design.

use fewbits_numerics::ArgumentError;

/// Why a quantizer, labelling, channel, density or report was refused. Crates that design quantizers of several sensors raise the same.
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
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }

    /// Refuses a table of more than `limit` entries.
    ///
    /// # Errors
    /// [`Error::TooLarge`].
    pub fn at_most(table: &'static str, needed: impl Into<u128>, limit: impl Into<u128>) -> Result<(), Self> {
        let (needed, limit) = (needed.into(), limit.into());
        if needed <= limit {
            return Ok(());
        }
        let saturated = |number| u64::try_from(number).unwrap_or(u64::MAX);
        Err(Self::TooLarge {
            table,
            needed: saturated(needed),
            limit: saturated(limit),
        })
    }
}

pub(crate) use fewbits_numerics::error::refuse;

impl From<Error> for fewbits_core::Error {
    /// The core's argument error, or its error for an iteration that did not converge.
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
            Error::ImpossibleOutcome => Self::Impossible,
            other => ArgumentError::new("design", other, "another setting").into(),
        }
    }
}
