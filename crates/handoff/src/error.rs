//! Errors of this crate.

fewbits_numerics::errors! {
    /// What a hand-over refuses.
    pub enum Error wraps {
        /// No particle agrees with the measurement, or particles could not be formed.
        Density(#[from] fewbits_densities::Error),
        /// The belief could not be reduced or coded.
        Codec(#[from] fewbits_mixture_codec::Error),
    } and {}
}
