//! The cross-section of a cylinder.

use super::bessel::{jn_derivative, zeros};
use super::slab::SlabWall;
use fewbits_models::Error;
use fewbits_numerics::error::positive;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Modes are summed until `exp(-40)` is left.
const DECAY: f64 = 40.0;
/// The largest zero that is ever computed.
const LARGEST_ZERO: f64 = 160.0;

/// The Green's function of diffusion in a disk: concentration (per m^2) of a unit mass released at one point of the
/// cross-section of an endless cylinder, or, times an `Axis` along it, of a cylinder in three dimensions.
///
/// Eigenfunctions `J_m(j rho / a) cos m (phi - phi0)`, `j` running over the zeros of `J_m'` (impermeable) or `J_m` (absorbing).
/// They are summed down to `exp(-40)` as long as that needs no zero above 160, that is for `kappa t > 0.0016 a^2`; before, the
/// wall is taken for flat (one image), which errs by a share of the order of `sqrt(kappa t) / a` next to the wall and by
/// nothing away from it.
#[derive(Debug, Clone)]
pub struct Cylinder {
    radius: f64,
    diffusivity: f64,
    wall: SlabWall,
    modes: OnceLock<Vec<Mode>>,
}

#[derive(Debug, Clone, Copy)]
struct Mode {
    order: i32,
    zero: f64,
    /// `eps_m / (pi N)` for a unit radius.
    weight: f64,
}

impl Cylinder {
    /// A cylinder of the given radius in metres; `diffusivity` in m^2/s.
    ///
    /// # Errors
    /// If `radius` or `diffusivity` is not a positive number.
    pub fn new(radius: f64, diffusivity: f64, wall: SlabWall) -> Result<Self, Error> {
        Ok(Self {
            radius: positive("radius", radius)?,
            diffusivity: positive("diffusivity", diffusivity)?,
            wall,
            modes: OnceLock::new(),
        })
    }

    /// Concentration at `field` = (rho, phi), `age` seconds after a unit mass was released at `source`, per m^2. Zero outside.
    pub fn green(&self, field: [f64; 2], source: [f64; 2], age: f64) -> f64 {
        let (rho, rho0) = (field[0] / self.radius, source[0] / self.radius);
        let inside = 0.0..=1.0;
        if age <= 0.0 || !inside.contains(&rho) || !inside.contains(&rho0) {
            return 0.0;
        }
        let angle = field[1] - source[1];
        let scaled = self.diffusivity * age / (self.radius * self.radius);
        let unit = if DECAY / scaled > LARGEST_ZERO * LARGEST_ZERO {
            short(rho, rho0, angle, scaled, self.wall)
        } else {
            self.series(rho, rho0, angle, scaled)
        };
        unit.max(0.0) / (self.radius * self.radius)
    }

    fn series(&self, rho: f64, rho0: f64, angle: f64, scaled: f64) -> f64 {
        let mut sum = if self.wall == SlabWall::Impermeable {
            1.0 / PI
        } else {
            0.0
        };
        for mode in self.modes.get_or_init(|| modes(self.wall)) {
            let exponent = mode.zero * mode.zero * scaled;
            if exponent > DECAY {
                // Modes are sorted by their zeros.
                break;
            }
            let shape = libm::jn(mode.order, mode.zero * rho) * libm::jn(mode.order, mode.zero * rho0);
            sum += mode.weight * (f64::from(mode.order) * angle).cos() * shape * (-exponent).exp();
        }
        sum
    }
}

/// Every mode of the unit disk, by increasing zero.
fn modes(wall: SlabWall) -> Vec<Mode> {
    let mut modes = Vec::new();
    for order in 0..LARGEST_ZERO as i32 {
        let m = f64::from(order);
        // No positive zero lies below the order.
        let start = m.max(0.5);
        let found = match wall {
            SlabWall::Impermeable => zeros(|x| jn_derivative(order, x), start, LARGEST_ZERO),
            SlabWall::Absorbing => zeros(|x| libm::jn(order, x), start, LARGEST_ZERO),
        };
        modes.extend(found.into_iter().map(|zero| {
            let norm = match wall {
                SlabWall::Impermeable => (1.0 - m * m / (zero * zero)) * libm::jn(order, zero).powi(2),
                SlabWall::Absorbing => libm::jn(order + 1, zero).powi(2),
            };
            let both_ways = if order == 0 { 1.0 } else { 2.0 };
            Mode {
                order,
                zero,
                weight: both_ways / (PI * norm),
            }
        }));
    }
    modes.sort_by(|a, b| a.zero.total_cmp(&b.zero));
    modes
}

/// Direct and mirrored Gaussian, the wall taken for flat at the point nearest to the source.
fn short(rho: f64, rho0: f64, angle: f64, scaled: f64, wall: SlabWall) -> f64 {
    let image = 2.0 - rho0;
    let at = |radius: f64| {
        let squared = rho * rho + radius * radius - 2.0 * rho * radius * angle.cos();
        (-squared / (4.0 * scaled)).exp()
    };
    let sign = match wall {
        SlabWall::Impermeable => 1.0,
        SlabWall::Absorbing => -1.0,
    };
    (at(rho0) + sign * at(image)) / (4.0 * PI * scaled)
}
