//! Errors of this crate.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// The measurement has probability zero for every particle, or particles could not be formed.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
    /// The belief could not be reduced or coded.
    #[error(transparent)]
    Codec(#[from] fewbits_mixture_codec::Error),
}
