//! The noise or correlation at which identical quantizers stop being a local optimum.

use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::Criterion;
use fewbits_quantizer_design::Error;
use fewbits_quantizer_design::system::System;
use nalgebra::SymmetricEigen;

/// Number of bisections; enough to reach the precision of the bracket.
const BISECTIONS: usize = 60;

/// The parameter between `low` and `high` at which the largest curvature of `criterion` changes sign.
///
/// `family(parameter)` must be a system at a stationary point of the criterion, such as two sign quantizers at zero in noise of
/// that standard deviation. Beyond the returned parameter some asymmetric change improves the criterion.
///
/// # Errors
/// [`Error::Argument`] if the curvature has the same sign at both ends; errors of `family`.
pub fn symmetry_breaking(
    mut low: f64,
    mut high: f64,
    criterion: Criterion,
    family: impl Fn(f64) -> Result<System, Error>,
) -> Result<f64, Error> {
    // The largest eigenvalue of the Hessian at the symmetric design; positive if an asymmetric change improves it.
    let curvature = |parameter: f64| -> Result<f64, Error> {
        let found = family(parameter)?.derivatives(criterion)?;
        Ok(SymmetricEigen::new(found.hessian * criterion.sense()).eigenvalues.max())
    };
    let positive_at_low = curvature(low)? > 0.0;
    if positive_at_low == (curvature(high)? > 0.0) {
        return refuse(
            "range",
            format!("[{low}, {high}]"),
            "ends between which the symmetric design loses its optimality",
        );
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if (curvature(middle)? > 0.0) == positive_at_low {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(0.5 * (low + high))
}
