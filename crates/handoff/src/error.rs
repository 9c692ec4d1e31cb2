//! Errors of this crate.

fewbits_numerics::errors! {
    /// What a hand-over refuses.
    pub enum Error wraps {
        /// The belief refused: no particle agrees with the measurement, or it does not fit its format.
        Density(#[from] fewbits_densities::Error),
    } and {}
}
