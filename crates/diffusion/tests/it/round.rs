//! Diffusion inside a ball or a cylinder: a sum of modes, or one image before the wall looks round.

use super::bessel::zeros;
use super::slab::SlabWall;
use fewbits_models::Error;
use fewbits_numerics::error::positive;
use std::f64::consts::PI;
use std::marker::PhantomData;
use std::sync::OnceLock;

/// Modes are summed until `exp(-40)` is left.
const DECAY: f64 = 40.0;

/// A round cross-section: its eigenfunctions are a radial function of the distance from the centre times an angular polynomial in the
/// cosine of the angle between field and source.
pub trait Shape {
    /// Number of coordinates.
    const DIMENSIONS: i32;
    /// The largest zero that is ever computed.
    const LARGEST_ZERO: f64;
    /// Concentration of a unit mass spread evenly over the unit body.
    const EVEN: f64;

    /// The radial function of an order, and its derivative.
    fn radial(order: u32, x: f64) -> f64;
    fn radial_slope(order: u32, x: f64) -> f64;

    /// Polynomial of order `n + 1` at `x`, from those of orders `n` and `n - 1`.
    fn next_polynomial(n: f64, x: f64, here: f64, below: f64) -> f64;

    /// The factor of an order's modes, and what the angle adds to the radial equation: `m^2`, or `l (l + 1)`.
    fn constants(order: f64) -> [f64; 2];
}

/// A body of one shape, with the modes of the unit body by increasing zero.
#[derive(Debug, Clone)]
pub struct Body<S> {
    pub radius: f64,
    diffusivity: f64,
    wall: SlabWall,
    modes: OnceLock<Vec<Mode>>,
    shape: PhantomData<S>,
}

#[derive(Debug, Clone, Copy)]
struct Mode {
    order: u32,
    zero: f64,
    weight: f64,
}

impl<S: Shape> Body<S> {
    /// A body of the given radius in metres; `diffusivity` in m^2/s.
    ///
    /// # Errors
    /// If `radius` or `diffusivity` is not a positive number.
    pub fn new(radius: f64, diffusivity: f64, wall: SlabWall) -> Result<Self, Error> {
        Ok(Self {
            radius: positive("radius", radius)?,
            diffusivity: positive("diffusivity", diffusivity)?,
            wall,
            modes: OnceLock::new(),
            shape: PhantomData,
        })
    }

    /// Concentration `age` seconds after a unit mass was released, at distances `r` and `r0` of field and source from the centre, in
    /// radii. Zero outside.
    pub fn concentration(&self, r: f64, r0: f64, cosine: f64, age: f64) -> f64 {
        let inside = 0.0..=1.0;
        if age <= 0.0 || !inside.contains(&r) || !inside.contains(&r0) {
            return 0.0;
        }
        let scaled = self.diffusivity * age / (self.radius * self.radius);
        let unit = if DECAY / scaled > S::LARGEST_ZERO * S::LARGEST_ZERO {
            self.short(r, r0, cosine, scaled)
        } else {
            self.series(r, r0, cosine, scaled)
        };
        unit.max(0.0) / self.radius.powi(S::DIMENSIONS)
    }

    fn series(&self, r: f64, r0: f64, cosine: f64, scaled: f64) -> f64 {
        // An impermeable wall has the constant as its slowest mode.
        let mut sum = match self.wall {
            SlabWall::Impermeable => S::EVEN,
            SlabWall::Absorbing => 0.0,
        };
        let polynomials = polynomials::<S>(cosine);
        for mode in self.modes.get_or_init(|| modes::<S>(self.wall)) {
            let exponent = mode.zero * mode.zero * scaled;
            if exponent > DECAY {
                // Modes are sorted by their zeros.
                break;
            }
            let shape = S::radial(mode.order, mode.zero * r) * S::radial(mode.order, mode.zero * r0);
            sum += mode.weight * polynomials[mode.order as usize] * shape * (-exponent).exp();
        }
        sum
    }

    /// Direct and mirrored Gaussian, the wall taken for flat at the point nearest to the source.
    fn short(&self, r: f64, r0: f64, cosine: f64, scaled: f64) -> f64 {
        let at = |radius: f64| (-(r * r + radius * radius - 2.0 * r * radius * cosine) / (4.0 * scaled)).exp();
        let sign = match self.wall {
            SlabWall::Impermeable => 1.0,
            SlabWall::Absorbing => -1.0,
        };
        (at(r0) + sign * at(2.0 - r0)) / (4.0 * PI * scaled).powf(0.5 * f64::from(S::DIMENSIONS))
    }
}

/// The angular polynomials of all orders.
fn polynomials<S: Shape>(x: f64) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for n in 1..S::LARGEST_ZERO as usize {
        values.push(S::next_polynomial(n as f64, x, values[n], values[n - 1]));
    }
    values
}

/// Every mode of the unit body, by increasing zero.
fn modes<S: Shape>(wall: SlabWall) -> Vec<Mode> {
    let mut modes = Vec::new();
    for order in 0..S::LARGEST_ZERO as u32 {
        // No positive zero lies below the order.
        let start = f64::from(order).max(0.5);
        let [factor, separation] = S::constants(f64::from(order));
        let found = match wall {
            SlabWall::Impermeable => zeros(|x| S::radial_slope(order, x), start, S::LARGEST_ZERO),
            SlabWall::Absorbing => zeros(|x| S::radial(order, x), start, S::LARGEST_ZERO),
        };
        modes.extend(found.into_iter().map(|zero| {
            let norm = match wall {
                SlabWall::Impermeable => (1.0 - separation / (zero * zero)) * S::radial(order, zero).powi(2),
                SlabWall::Absorbing => S::radial(order + 1, zero).powi(2),
            };
            Mode {
                order,
                zero,
                weight: factor / (PI * norm),
            }
        }));
    }
    modes.sort_by(|a, b| a.zero.total_cmp(&b.zero));
    modes
}
