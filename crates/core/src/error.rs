//! What can go wrong with a word of this crate.

use fewbits_numerics::ArgumentError;

/// Errors of this crate; the crates above wrap it in their own.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// What was observed has probability zero under the belief.
    #[error("the observation is impossible under the belief")]
    Impossible,
    /// An integral did not reach its accuracy.
    #[error("the moments of the posterior did not converge within {evaluations} evaluations of the likelihood")]
    NotConverged {
        /// Evaluations of the integrand that were spent.
        evaluations: usize,
    },
}
