//! What the filters refuse, and what can go wrong with a belief.

use fewbits_numerics::ArgumentError;

/// Errors of this crate. A failed step leaves the old belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A plant that outruns its bits: one bit moves the estimate by a bounded step, so an error beyond `gain / (|a| - 1)`
    /// grows for ever, although the computed variance stays finite.
    #[error(
        "the plant coefficient is {coefficient}: expected one in [-1, 1], because a bounded correction cannot hold an \
         unstable plant (`new_unstable` accepts the risk)"
    )]
    UnstablePlant {
        /// The offending coefficient.
        coefficient: f64,
    },
    /// A model refused its parameters.
    #[error(transparent)]
    Model(fewbits_models::Error),
    /// A filter below failed.
    #[error(transparent)]
    Filter(#[from] fewbits_filters::Error),
    /// No quantizer table.
    #[error(transparent)]
    Quantizer(#[from] fewbits_quantizers::Error),
    /// The message has probability zero under the belief, to the last digit of its logarithm.
    #[error("the message is impossible under the belief")]
    ImpossibleMessage,
    /// An iteration did not settle.
    #[error("{what} did not settle within {iterations} iterations")]
    NotConverged {
        /// What was iterated.
        what: &'static str,
        /// Iterations spent.
        iterations: usize,
    },
}

impl From<fewbits_models::Error> for Error {
    fn from(error: fewbits_models::Error) -> Self {
        match error {
            fewbits_models::Error::UnstablePlant { coefficient } => Self::UnstablePlant { coefficient },
            fewbits_models::Error::Argument(argument) => Self::Argument(argument),
            other => Self::Model(other),
        }
    }
}
