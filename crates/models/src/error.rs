//! Errors of this crate.

fewbits_numerics::errors! {
    /// Errors of this crate.
    pub enum Error {
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
}
