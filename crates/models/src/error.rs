//! Errors of this crate.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A coefficient outside `[-1, 1]` where the state would grow without bound.
    #[error("the coefficient is {coefficient}: the state grows without bound unless it lies in [-1, 1]")]
    UnstablePlant {
        /// The offending coefficient.
        coefficient: f64,
    },
    /// The dynamics have no stationary distribution.
    #[error(
        "the dynamics have no stationary distribution: an eigenvalue of the transition lies on or outside the unit circle"
    )]
    NotStationary,
}
