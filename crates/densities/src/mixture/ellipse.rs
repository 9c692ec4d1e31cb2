//! Outlines of Gaussians in the plane.

use crate::Error;
use fewbits_core::Gaussian;
use fewbits_numerics::error::refuse;
use fewbits_numerics::factored::Factored;
use nalgebra::SVector;

/// Level in the open interval from 0 to 1.
fn level(value: f64) -> Result<f64, Error> {
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        refuse("level", value, "a number above 0 and below 1")
    }
}

/// Outline of the ellipse that holds probability `level` of a Gaussian in the plane, as `points` points. Its squared radius in
/// standard deviations is `-2 ln(1 - level)`.
///
/// # Errors
/// If the level is not strictly between 0 and 1 or the covariance is singular.
pub fn ellipse(gaussian: &Gaussian<2>, at: f64, points: usize) -> Result<Vec<[f64; 2]>, Error> {
    let radius = (-2.0 * (-level(at)?).ln_1p()).sqrt();
    let factor = Factored::new("covariance", gaussian.covariance())?;
    Ok((0..points)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / points as f64).sin_cos();
            let x = gaussian.mean() + factor.lower * SVector::<f64, 2>::new(radius * cos, radius * sin);
            [x[0], x[1]]
        })
        .collect())
}
