//! Why an experiment could not run.

use thiserror::Error;

/// Why an experiment could not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter the figure does not have.
    #[error("figure `{figure}` has no parameter `{name}`: expected one of {valid}")]
    UnknownParameter {
        /// Id of the figure.
        figure: &'static str,
        /// The unknown name.
        name: String,
        /// The parameters it has.
        valid: String,
    },
    /// A parameter of the wrong type or out of range.
    #[error("parameter `{name}` of figure `{figure}` is `{value}`: {reason}")]
    Refused {
        /// Id of the figure.
        figure: &'static str,
        /// The parameter, or the entry of it, such as `a[0]`.
        name: String,
        /// The refused value.
        value: String,
        /// Why.
        reason: String,
    },
    /// A run that would take too long or too much memory.
    #[error("figure `{figure}` would need about {need:.1e} {unit} at these settings, beyond {limit:.1e}")]
    TooLarge {
        /// Id of the figure.
        figure: &'static str,
        /// The estimate.
        need: f64,
        /// The most that is accepted.
        limit: f64,
        /// Of what.
        unit: &'static str,
    },
    /// A table was built or read wrongly, or holds a number that is not finite.
    #[error("table: {0}")]
    Table(String),
    /// The run was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// A crate below failed.
    #[error("{0}")]
    Failed(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl Error {
    /// Wraps the error of a crate below.
    pub fn failed(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Failed(Box::new(source))
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
