//! The error type of this crate.

/// Errors of this crate; the crates above wrap it in their own.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// The observation has probability zero under the belief.
    #[error("the observation is impossible under the belief")]
    Impossible,
    /// A likelihood, model, belief or filter of the caller gave NaN (or an infinite likelihood). The observation itself may be correct.
    #[error("{what} is no number: expected numbers from the caller's likelihood and models")]
    NotANumber {
        /// Name of the quantity that is NaN or infinite.
        what: &'static str,
    },
    /// An integral did not reach the required accuracy.
    #[error("the moments of the posterior did not converge within {evaluations} evaluations of the likelihood")]
    NotConverged {
        /// Number of evaluations of the integrand.
        evaluations: usize,
    },
}

impl Error {
    /// The error for an update whose result is not finite: `Impossible` if `log_evidence` is `-inf`, otherwise `NotANumber` with `what`.
    pub fn unlikely_or_no_number(log_evidence: f64, what: &'static str) -> Self {
        if log_evidence == f64::NEG_INFINITY {
            Self::Impossible
        } else {
            Self::NotANumber { what }
        }
    }
}
