//! Errors of this crate.

/// What a hand-over refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// No particle agrees with the measurement, or particles could not be formed.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
    /// The belief could not be reduced or coded.
    #[error(transparent)]
    Codec(#[from] fewbits_mixture_codec::Error),
}
