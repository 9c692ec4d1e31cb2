//! The error type of this crate, and of densities, models, filters and estimators.

use crate::bits::CodecError;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::roots::RootError;

/// Errors of this crate, and of all crates above it that re-export it as theirs.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A message that does not fit its format, or bits that are no message.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The observation has probability zero under the belief.
    #[error("the observation is impossible under the belief")]
    Impossible,
    /// A likelihood, model, belief or filter of the caller gave NaN (or an infinite likelihood). The observation itself may be correct.
    #[error("{what} is no number: expected numbers from the caller's likelihood and models")]
    NotANumber {
        /// Name of the quantity that is NaN or infinite.
        what: &'static str,
    },
    /// An integral or an iteration did not reach the required accuracy.
    #[error("{what} did not converge within {steps} {unit}")]
    NotConverged {
        /// What was computed.
        what: &'static str,
        /// Steps that were spent.
        steps: usize,
        /// What a step is: iterations, evaluations.
        unit: &'static str,
    },
    /// The innovation covariance has no Cholesky factor.
    #[error("the innovation covariance is not positive definite: the belief or the sensing noise is no covariance")]
    SingularInnovation,
    /// A grid is too coarse for the density: it is a ridge too thin, or of too many modes, to follow.
    #[error("the grid does not resolve the density: {value} {unit}, expected {expected}")]
    Unresolved {
        /// The number that is out of range.
        value: f64,
        /// What it counts.
        unit: &'static str,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// The density has no peak of the shape that an approximation by a Gaussian needs.
    #[error("no Gaussian peak: {reason}")]
    NoPeak {
        /// Reason.
        reason: &'static str,
    },
    /// The variance of the state, or of its estimate, has no finite limit.
    #[error("the variance has no finite steady state: a part of the state is unstable and not observed well enough")]
    NoSteadyState,
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }

    /// The error for an update whose result is not finite: `Impossible` if `log_evidence` is `-inf`, otherwise `NotANumber` with `what`.
    pub fn unlikely_or_no_number(log_evidence: f64, what: &'static str) -> Self {
        if log_evidence == f64::NEG_INFINITY {
            Self::Impossible
        } else {
            Self::NotANumber { what }
        }
    }
}

impl From<RootError> for Error {
    fn from(error: RootError) -> Self {
        match error {
            RootError::Argument(argument) => Self::Argument(argument),
            RootError::NotBracketed { .. } => ArgumentError::new("bracket", error, "an interval around a root").into(),
            RootError::NotConverged { evaluations: steps, .. } => Self::NotConverged {
                what: "a search for a root",
                steps,
                unit: "evaluations",
            },
            _ => Self::NotANumber {
                what: "a function whose root is searched",
            },
        }
    }
}
