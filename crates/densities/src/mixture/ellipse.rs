//! Probability ellipses of Gaussians in the plane.

use crate::Error;
use fewbits_core::Gaussian;
use fewbits_numerics::error::refuse;
use fewbits_numerics::factored::Factored;
use nalgebra::SVector;

/// `points` points on the ellipse that holds probability `level` of a Gaussian in the plane. The ellipse is the set of squared
/// Mahalanobis distance `-2 ln(1 - level)`.
///
/// # Errors
/// If the level is not strictly between 0 and 1 or the covariance is singular.
pub fn ellipse(gaussian: &Gaussian<2>, level: f64, points: usize) -> Result<Vec<[f64; 2]>, Error> {
    if !(level > 0.0 && level < 1.0) {
        return refuse("level", level, "a number above 0 and below 1");
    }
    let radius = (-2.0 * (-level).ln_1p()).sqrt();
    let factor = Factored::new("covariance", gaussian.covariance())?;
    let at = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / points as f64).sin_cos();
        (gaussian.mean() + factor.lower * SVector::<f64, 2>::new(radius * cos, radius * sin)).into()
    };
    Ok((0..points).map(at).collect())
}
