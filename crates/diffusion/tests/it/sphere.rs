//! The inside of a ball.

use super::bessel::{spherical, spherical_derivative};
use super::round::{Body, Shape};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// The Green's function of diffusion in a ball about the origin: concentration (per m^3) of a unit mass.
///
/// Eigenfunctions `j_l(b r / a) P_l(cos gamma)`, `b` running over the zeros of `j_l'` (impermeable) or `j_l` (absorbing). They
/// are summed down to `exp(-40)` as long as that needs no zero above 100, that is for `kappa t > 0.004 a^2`; before, the wall
/// is taken for flat (one image), which errs by a share of the order of `sqrt(kappa t) / a` next to the wall.
pub type Sphere = Body<Ball>;

#[derive(Debug, Clone)]
pub struct Ball;

impl Shape for Ball {
    const DIMENSIONS: i32 = 3;
    const LARGEST_ZERO: f64 = 100.0;
    const EVEN: f64 = 0.75 / PI;

    fn radial(order: u32, x: f64) -> f64 {
        spherical(order, x)
    }

    fn radial_slope(order: u32, x: f64) -> f64 {
        spherical_derivative(order, x)
    }

    /// Legendre.
    fn next_polynomial(n: f64, x: f64, here: f64, below: f64) -> f64 {
        ((2.0 * n + 1.0) * x * here - n * below) / (n + 1.0)
    }

    fn constants(order: f64) -> [f64; 2] {
        [order + 0.5, order * (order + 1.0)]
    }
}

impl Sphere {
    /// Concentration at `field`, `age` seconds after a unit mass was released at `source`, per m^3. Zero outside the ball.
    pub fn green(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64 {
        let (a, b) = (field / self.radius, source / self.radius);
        let (r, r0) = (a.norm(), b.norm());
        let cosine = if r > 0.0 && r0 > 0.0 {
            (a.dot(&b) / (r * r0)).clamp(-1.0, 1.0)
        } else {
            1.0
        };
        self.concentration(r, r0, cosine, age)
    }
}
