//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a quantizer, labelling, channel, density or report was refused.
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

/// Shorthand for an argument error of this crate.
pub(crate) fn refuse<T>(
    name: &'static str,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> Result<T, Error> {
    Err(ArgumentError::new(name, value, expected).into())
}

impl From<Error> for fewbits_core::Error {
    /// What a scheme reports: the argument, or that nothing converged.
    fn from(error: Error) -> Self {
        match error {
            Error::Argument(argument) => Self::Argument(argument),
            Error::NotConverged { iterations, .. } => Self::NotConverged {
                evaluations: iterations,
            },
            Error::TooLarge { table, needed, limit } => {
                ArgumentError::new("table", format!("{table} of {needed} entries"), format!("at most {limit}")).into()
            }
        }
    }
}
