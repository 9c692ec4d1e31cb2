//! The cross-section of a cylinder.

use super::bessel::jn_derivative;
use super::round::{Body, Shape};
use std::f64::consts::PI;

/// The Green's function of diffusion in a disk: concentration (per m^2) of a unit mass released at one point of the
/// cross-section of an endless cylinder, or, times an `Axis` along it, of a cylinder in three dimensions.
///
/// Eigenfunctions `J_m(j rho / a) cos m (phi - phi0)`, `j` running over the zeros of `J_m'` (impermeable) or `J_m` (absorbing).
/// They are summed down to `exp(-40)` as long as that needs no zero above 160, that is for `kappa t > 0.0016 a^2`; before, the
/// wall is taken for flat (one image), which errs by a share of the order of `sqrt(kappa t) / a` next to the wall and by
/// nothing away from it.
pub type Cylinder = Body<Disk>;

#[derive(Debug, Clone)]
pub struct Disk;

impl Shape for Disk {
    const DIMENSIONS: i32 = 2;
    const LARGEST_ZERO: f64 = 160.0;
    const EVEN: f64 = 1.0 / PI;

    fn radial(order: u32, x: f64) -> f64 {
        libm::jn(order as i32, x)
    }

    fn radial_slope(order: u32, x: f64) -> f64 {
        jn_derivative(order as i32, x)
    }

    /// Chebyshev: `cos m phi` as a polynomial in `cos phi`.
    fn next_polynomial(_: f64, x: f64, here: f64, below: f64) -> f64 {
        2.0 * x * here - below
    }

    /// Both directions around the axis count.
    fn constants(order: f64) -> [f64; 2] {
        [if order == 0.0 { 1.0 } else { 2.0 }, order * order]
    }
}

impl Cylinder {
    /// Concentration at `field` = (rho, phi), `age` seconds after a unit mass was released at `source`, per m^2. Zero outside.
    pub fn green(&self, field: [f64; 2], source: [f64; 2], age: f64) -> f64 {
        let [rho, rho0] = [field, source].map(|at| at[0] / self.radius);
        self.concentration(rho, rho0, (field[1] - source[1]).cos(), age)
    }
}
