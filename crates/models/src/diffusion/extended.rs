//! Moving sources and sources that cover an area.

use super::air::Air;
use crate::Error;
use fewbits_numerics::error::{all_finite, at_least_one, positive};
use fewbits_numerics::quadrature::Rule;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// Concentration per unit rate at `field`, `age` seconds after a source at `start` began to release at a constant rate and to move with
/// the given velocity (m/s).
///
/// In the frame of the source the wind is `wind - velocity`. The closed form of [`Air`] therefore holds, with the offset measured
/// from the **present** position of the source. The ground is that of `air`.
///
/// # Errors
/// If `velocity` is not finite, or has a vertical component above ground.
pub fn moving_source(
    air: &Air,
    field: &Vector3<f64>,
    start: &Vector3<f64>,
    velocity: &Vector3<f64>,
    age: f64,
) -> Result<f64, Error> {
    all_finite("velocity", velocity.as_slice())?;
    let relative = air.with_wind(air.wind() - velocity)?;
    Ok(relative.concentration(field, &(start + velocity * age), age))
}

/// Concentration per unit of **total** rate of a uniform disk of the given radius (m) around `centre` in the plane `z = height`.
/// Quadrature: Gauss-Legendre in the squared radius with `rings` points, trapezoid rule in the angle with `2 rings` points.
///
/// The error falls exponentially with `rings` while the field point is outside the disk: 16 rings give about ten digits at three radii.
///
/// # Errors
/// If `radius` is not a positive number or `rings` is zero.
pub fn disk_source(
    air: &Air,
    field: &Vector3<f64>,
    (centre, height): (Vector2<f64>, f64),
    radius: f64,
    age: f64,
    rings: usize,
) -> Result<f64, Error> {
    positive("radius", radius)?;
    at_least_one("rings", rings)?;
    let spokes = 2 * rings;
    let rule = Rule::gauss_legendre(rings);
    let mut sum = 0.0;
    for (squared, weight) in rule.on(0.0, 1.0) {
        let rho = radius * squared.sqrt();
        for spoke in 0..spokes {
            let angle = TAU * (spoke as f64 + 0.5) / spokes as f64;
            let source = Vector3::new(centre.x + rho * angle.cos(), centre.y + rho * angle.sin(), height);
            sum += weight * air.concentration(field, &source, age);
        }
    }
    // The area element is radius^2 d(squared) d(angle) / 2, the density 1 / (pi radius^2).
    Ok(sum * (TAU / spokes as f64) * 0.5 / PI)
}
