//! The region on the ground where the concentration exceeds a threshold.

use super::air::{Air, Ground, MIN_MAGNITUDE};
use super::space::ImpulseResponse;
use crate::Error;
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_numerics::roots::bracketed;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// Radius (m) of the disk on impermeable ground, without wind, in which the concentration of a source exceeds `threshold` (kg/m^3), `age`
/// seconds after it began to release `rate` (kg/s). It is the root `R` of `rate erfc(R / sqrt(4 kappa t)) / (2 pi kappa R) = threshold`;
/// zero at age zero.
///
/// # Errors
/// If `rate`, `threshold` or `diffusivity` is not a positive number.
pub fn contour_radius(rate: f64, threshold: f64, age: f64, diffusivity: f64) -> Result<f64, Error> {
    positive("rate", rate)?;
    positive("threshold", threshold)?;
    let air = Air::new(diffusivity, Vector3::zeros(), Ground::Impermeable)?.with_closest(MIN_MAGNITUDE)?;
    Ok(reach(&air, &Vector3::zeros(), &Vector3::x(), rate, threshold, age))
}

/// The contour `c = threshold` on the ground around a source, one point for each of `directions` equally spaced angles from the
/// downwind direction (the x axis without wind). Every ray from the source crosses the contour exactly once, because the concentration of a
/// continuous point source decreases along every ray. If the threshold is not exceeded anywhere, all points are at the source.
///
/// # Errors
/// If `rate` or `threshold` is not a positive number, or `directions` is zero.
pub fn contour(
    air: &Air,
    source: &Vector2<f64>,
    rate: f64,
    threshold: f64,
    age: f64,
    directions: usize,
) -> Result<Vec<Vector2<f64>>, Error> {
    positive("rate", rate)?;
    positive("threshold", threshold)?;
    at_least_one("directions", directions)?;
    let wind = air.wind();
    let downwind = wind.y.atan2(wind.x);
    let origin = Vector3::new(source.x, source.y, 0.0);
    Ok((0..directions)
        .map(|i| {
            let angle = downwind + TAU * i as f64 / directions as f64;
            let ray = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let radius = reach(air, &origin, &ray, rate, threshold, age);
            Vector2::new(origin.x + radius * ray.x, origin.y + radius * ray.y)
        })
        .collect())
}

/// Distance along a ray at which the concentration equals the threshold.
fn reach(air: &Air, source: &Vector3<f64>, ray: &Vector3<f64>, rate: f64, threshold: f64, age: f64) -> f64 {
    let excess = |log_radius: f64| {
        let field = source + ray * log_radius.exp();
        (rate * air.concentration(&field, source, age) / threshold).ln()
    };
    // Upper bound: without the factor erfc, c < rate / (2 pi kappa R); wind increases c at most to this value, downwind.
    let high = rate / (2.0 * PI * air.diffusivity() * threshold);
    let low = air.closest().max(high * 1e-12).ln();
    if excess(low) > 0.0 {
        // If rounding leaves no change of sign, the root is at the bound.
        bracketed(excess, low, high.ln(), 0.0).map_or(high, f64::exp)
    } else {
        0.0
    }
}
