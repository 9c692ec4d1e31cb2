//! The error of this crate.

use fewbits_core::ArgumentError;

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
}

/// Shorthand for an argument error of this crate.
pub(crate) fn refuse<T>(
    name: &'static str,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> Result<T, Error> {
    Err(ArgumentError::new(name, value, expected).into())
}
