//! Why an experiment could not run.

use std::fmt::Display;
use thiserror::Error;

/// Why an experiment could not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The run was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// A parameter is refused, the run would be too large, or a computation failed: why.
    #[error("{0}")]
    Failed(String),
}

impl Error {
    /// Says why.
    pub fn failed(reason: impl Display) -> Self {
        Self::Failed(reason.to_string())
    }

    /// A parameter of the wrong type or out of range; `name` may be the entry of one, such as `a[0]`.
    pub(crate) fn refused(figure: &str, name: &str, value: &str, reason: impl Display) -> Self {
        Self::Failed(format!("parameter `{name}` of figure `{figure}` is `{value}`: {reason}"))
    }
}

impl From<fewbits_monte_carlo::MonteCarloError> for Error {
    fn from(error: fewbits_monte_carlo::MonteCarloError) -> Self {
        match error {
            fewbits_monte_carlo::MonteCarloError::Cancelled => Self::Cancelled,
            other => Self::failed(other),
        }
    }
}

macro_rules! failed {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::failed(error)
            }
        })+
    };
}
failed!(
    fewbits_core::CodecError,
    fewbits_core::Error,
    fewbits_diffusion::Error,
    fewbits_network::Error,
    fewbits_numerics::ArgumentError,
    fewbits_quantizers::Error,
);
