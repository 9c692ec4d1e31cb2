//! The error of quantizers and their design, and a check that raises it.

pub use fewbits_quantizers::Error;

use fewbits_numerics::ArgumentError;
pub(crate) use fewbits_numerics::error::refuse;

/// [`Error::NotConverged`].
pub(crate) fn not_converged(algorithm: &'static str, iterations: usize, change: f64) -> Error {
    Error::NotConverged {
        algorithm,
        iterations,
        change,
    }
}

/// Reads a stored size: finite, and not negative except for rounding.
pub(crate) fn stored_size<'de, D: serde::Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    let size = <f64 as serde::Deserialize>::deserialize(source)?;
    if size.is_finite() && size >= -1e-9 {
        Ok(size)
    } else {
        Err(serde::de::Error::custom(ArgumentError::new("value", size, "a finite number that is not negative")))
    }
}
