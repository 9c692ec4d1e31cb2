//! Diffusion along a coordinate `z > 0` above a wall at 0.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::non_negative;
use fewbits_numerics::normal::erfcx;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

const SQRT_PI: f64 = 1.772_453_850_905_516;
/// Above this argument, `1 - sqrt(pi) x erfcx(x)` is computed by its asymptotic series.
const SERIES_FROM: f64 = 12.0;

/// Boundary condition of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Wall {
    /// Loss velocity, m/s; infinite for an absorbing wall.
    loss: f64,
}

impl Wall {
    /// Impermeable: no flux, `dc/dz = 0`.
    pub const IMPERMEABLE: Self = Self { loss: 0.0 };
    /// Absorbing: `c = 0`.
    pub const ABSORBING: Self = Self { loss: f64::INFINITY };

    /// A wall that absorbs `loss * c` per unit of area and time: `kappa dc/dz = loss * c`, with `loss` in m/s.
    /// 0 is impermeable, infinity is absorbing.
    ///
    /// # Errors
    /// If `loss` is negative or NaN.
    pub fn permeable(loss: f64) -> Result<Self, ArgumentError> {
        if loss == f64::INFINITY {
            return Ok(Self::ABSORBING);
        }
        Ok(Self {
            loss: non_negative("loss", loss)?,
        })
    }

    /// Loss velocity, m/s.
    pub(crate) fn loss(&self) -> f64 {
        self.loss
    }
}

/// The flux that equals `loss * c` at a wall, if wind blows across the wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Flux {
    /// Diffusion and wind together. Mass is never created.
    #[default]
    Total,
    /// Diffusion alone, as equation (4) of the paper is printed. Wind away from the wall then creates mass.
    Diffusive,
}

impl TryFrom<f64> for Wall {
    type Error = ArgumentError;

    fn try_from(loss: f64) -> Result<Self, ArgumentError> {
        Self::permeable(loss)
    }
}

impl From<Wall> for f64 {
    fn from(wall: Wall) -> Self {
        wall.loss
    }
}

/// `1 - sqrt(pi) x erfcx(x)`, positive, without cancellation for large `x`.
fn one_minus_scaled(x: f64) -> f64 {
    if x < SERIES_FROM {
        return 1.0 - SQRT_PI * x * erfcx(x);
    }
    // 1/(2x^2) - 3/(4x^4) + 15/(8x^6) - ...: at x = 12 the twelfth term is below 1e-16 of the first.
    let q = 0.5 / (x * x);
    let (mut term, mut sum) = (q, q);
    for k in 1..12 {
        term *= -q * (2 * k + 1) as f64;
        sum += term;
    }
    sum
}

/// `exp(shift)` times the Green's function of equation (5). `loss` is the loss velocity after the wind transform and may be negative.
///
/// `direct - image + 2 image (1 - sqrt(pi) H erfcx(H + w))`, `w = (z + z0) / sqrt(4 kappa t)`, `H = loss sqrt(t / kappa)`: the
/// paper's formula with the terms paired so that none cancels.
pub(super) fn green(z: f64, z0: f64, age: f64, diffusivity: f64, loss: f64, shift: f64) -> f64 {
    if age <= 0.0 || z < 0.0 || z0 < 0.0 {
        return 0.0;
    }
    let spread = 4.0 * diffusivity * age;
    let prefactor = 1.0 / (PI * spread).sqrt();
    let (difference, total) = (z - z0, z + z0);
    let direct = (shift - difference * difference / spread).exp();
    let kept = direct * -(-4.0 * z * z0 / spread).exp_m1();
    if loss == f64::INFINITY {
        return prefactor * kept;
    }
    let w = total / spread.sqrt();
    let h = loss * (age / diffusivity).sqrt();
    let x = h + w;
    let wall = if x >= 0.0 {
        // 1 - sqrt(pi) (x - w) erfcx(x)
        2.0 * (shift - w * w).exp() * (one_minus_scaled(x) + SQRT_PI * w * erfcx(x))
    } else {
        // erfcx(x) exp(-w^2) = exp(h^2 + 2 h w) erfc(x): the exponents are added first, because each exponential alone may overflow.
        2.0 * ((shift - w * w).exp() - SQRT_PI * h * (shift + h * (h + 2.0 * w)).exp() * libm::erfc(x))
    };
    prefactor * (kept + wall)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_literal_formula_where_it_does_not_overflow() {
        for (z, z0, t, k, a) in [
            (0.5, 1.0, 1.0, 1.3, 0.8),
            (0.0, 1.0, 1.0, 1.3, 5.0),
            (2.0, 1.0, 0.3, 40.0, 12.0),
        ] {
            let s: f64 = 4.0 * k * t;
            let h: f64 = a / k;
            let total: f64 = z + z0;
            let literal = ((-(z - z0) * (z - z0) / s).exp() + (-total * total / s).exp()) / (PI * s).sqrt()
                - h * (h * total + h * h * k * t).exp() * libm::erfc(total / s.sqrt() + h * (k * t).sqrt());
            assert!((green(z, z0, t, k, a, 0.0) / literal - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn series_meets_the_difference() {
        let (below, above) = (1.0 - SQRT_PI * SERIES_FROM * erfcx(SERIES_FROM), one_minus_scaled(SERIES_FROM));
        assert!((below / above - 1.0).abs() < 1e-12);
    }

    #[test]
    fn walls_are_checked() {
        assert!(Wall::permeable(-0.1).is_err() && Wall::permeable(f64::NAN).is_err());
        assert_eq!(Wall::permeable(f64::INFINITY), Ok(Wall::ABSORBING));
    }
}
