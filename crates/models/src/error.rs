//! Errors of this crate.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A coefficient outside `[-1, 1]`, with which the state would grow without bound.
    #[error("the coefficient is {coefficient}: the state grows without bound unless it lies in [-1, 1]")]
    UnstablePlant {
        /// The coefficient that was given.
        coefficient: f64,
    },
    /// The dynamics have no stationary distribution.
    #[error(
        "the dynamics have no stationary distribution: an eigenvalue of the transition lies on or outside the unit circle"
    )]
    NotStationary,
}
