//! What can go wrong with a word of this crate.

fewbits_numerics::errors! {
    /// Errors of this crate; the crates above wrap it in their own.
    pub enum Error {
        /// What was observed has probability zero under the belief.
        #[error("the observation is impossible under the belief")]
        Impossible,
        /// An integral did not reach its accuracy.
        #[error("the moments of the posterior did not converge within {evaluations} evaluations of the likelihood")]
        NotConverged {
            /// Evaluations of the integrand that were spent.
            evaluations: usize,
        },
    }
}
