//! What can go wrong with a word of this crate.

/// Errors of this crate; the crates above wrap it in their own.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// What was observed has probability zero under the belief.
    #[error("the observation is impossible under the belief")]
    Impossible,
    /// A NaN (or an infinite likelihood) came out of what the caller handed over: a likelihood, a model, a belief, a filter. The
    /// observation is not to blame.
    #[error("{what} is no number: expected numbers from the caller's likelihood and models")]
    NotANumber {
        /// What is no number.
        what: &'static str,
    },
    /// An integral did not reach its accuracy.
    #[error("the moments of the posterior did not converge within {evaluations} evaluations of the likelihood")]
    NotConverged {
        /// Evaluations of the integrand that were spent.
        evaluations: usize,
    },
}

impl Error {
    /// What a result that is not finite means: probability zero if its log evidence is `-inf`, otherwise `what` is no number.
    pub fn unlikely_or_no_number(log_evidence: f64, what: &'static str) -> Self {
        if log_evidence == f64::NEG_INFINITY {
            Self::Impossible
        } else {
            Self::NotANumber { what }
        }
    }
}
