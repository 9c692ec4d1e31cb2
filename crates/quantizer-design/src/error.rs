//! The error of quantizers and their design, and a check that raises it.

pub use fewbits_quantizers::Error;

pub(crate) use fewbits_numerics::error::refuse;

/// [`Error::NotConverged`].
pub(crate) fn not_converged(algorithm: &'static str, iterations: usize, change: f64) -> Error {
    Error::NotConverged {
        algorithm,
        iterations,
        change,
    }
}
