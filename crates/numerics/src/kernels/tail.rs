//! The normal distribution computed from one scaled tail probability, without branches.
//!
//! `T(t) = Phi(-t) exp(t^2/2)` for `t >= 0` falls from one half to zero as `1/(t sqrt(2 pi))`. It never underflows, and `Phi`,
//! `ln Phi`, `phi/Phi` and `erfcx` are each an exponential or a logarithm away from it.

use super::elementary::{exp_minus_half_square, exp_sum, half_square, ln_corrected, polynomial, select};
use crate::constants::INV_SQRT_2PI;
use std::f64::consts::SQRT_2;

/// The polynomial's variable is `q = (t - 5)/(t + 5)`.
const CENTRE: f64 = 5.0;

/// `(1 + t) T(t)` as a polynomial in `q`, from its Chebyshev series with 60 digits (relative error 1e-17). The first coefficient
/// is changed by two units in the last place so that the polynomial gives exactly one half at `t = 0`.
const TAIL: [f64; 24] = [
    0.461_515_829_850_037_86,
    -0.091_552_281_834_009_04,
    0.031_030_368_425_963_708,
    0.010_002_352_385_229_382,
    -0.026_401_042_966_308_307,
    0.024_536_963_243_678_652,
    -0.015_170_415_402_514_863,
    0.006_522_000_667_783_896,
    -0.001_676_072_344_554_57,
    7.791_597_409_338_999e-6,
    0.000_182_334_145_116_438_43,
    -5.360_758_111_487_22e-5,
    -9.896_097_759_279_782e-6,
    9.059_824_681_256_64e-6,
    -7.034_644_683_537_2e-8,
    -1.307_448_601_923_76e-6,
    1.278_782_218_209_382_5e-7,
    1.962_780_992_009_133e-7,
    -2.628_620_508_989_970_7e-8,
    -3.095_201_755_804_319e-8,
    3.627_373_163_401_613_7e-9,
    4.401_159_622_760_416e-9,
    -2.822_077_229_063_753e-10,
    -3.815_816_262_633_87e-10,
];

/// `T(t)` for `t >= 0`, within five units in the last place; zero at infinity.
#[inline(always)]
pub(crate) fn scaled_tail(t: f64) -> f64 {
    let q = 1.0 - 2.0 * CENTRE / (t + CENTRE);
    polynomial(&TAIL, q) / (1.0 + t)
}

/// `erfcx(x) = exp(x^2) erfc(x)`: within six units in the last place; `+inf` below -26.62, zero at infinity.
#[inline(always)]
pub fn erfcx(x: f64) -> f64 {
    let right = 2.0 * scaled_tail(SQRT_2 * x.abs());
    let (high, low) = half_square(x);
    let left = 2.0 * exp_sum(2.0 * high, 2.0 * low) - right;
    select(x < 0.0, left, right)
}

/// `phi(x)`: within three units in the last place, far tails included.
#[inline(always)]
pub fn pdf(x: f64) -> f64 {
    INV_SQRT_2PI * exp_minus_half_square(x)
}

/// Quantities that `cdf`, `log_cdf` and `inverse_mills` at `x` share.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    /// `T(|x|)`.
    pub scaled: f64,
    /// `exp(-x^2/2)`.
    pub decay: f64,
    /// `Phi(-|x|)`.
    pub outside: f64,
}

/// Computes the shared quantities with one scaled tail and one exponential.
#[inline(always)]
pub(crate) fn cut(x: f64) -> Cut {
    let scaled = scaled_tail(x.abs());
    let decay = exp_minus_half_square(x);
    Cut {
        scaled,
        decay,
        outside: scaled * decay,
    }
}

impl Cut {
    #[inline(always)]
    pub(crate) fn cdf(self, x: f64) -> f64 {
        select(x > 0.0, 1.0 - self.outside, self.outside)
    }

    #[inline(always)]
    pub(crate) fn log_cdf(self, x: f64) -> f64 {
        // One logarithm for both signs of `x`: of a number above 1/2 on the right, and of the scaled tail, without the exponential, on the
        // left.
        let rest = 1.0 - self.outside;
        let lost = ((1.0 - rest) - self.outside) * (2.0 - rest);
        let right = x > 0.0;
        let value = ln_corrected(select(right, rest, self.scaled), select(right, lost, 0.0));
        value - select(right, 0.0, 0.5 * x * x)
    }

    #[inline(always)]
    pub(crate) fn inverse_mills(self, x: f64) -> f64 {
        let right = x > 0.0;
        let (above, below) = (select(right, self.decay, 1.0), select(right, 1.0 - self.outside, self.scaled));
        INV_SQRT_2PI * above / below
    }
}

/// `Phi(x)`: within six units in the last place in both tails.
#[inline(always)]
pub fn cdf(x: f64) -> f64 {
    cut(x).cdf(x)
}

/// `ln Phi(x)`: within six units in the last place.
#[inline(always)]
pub fn log_cdf(x: f64) -> f64 {
    cut(x).log_cdf(x)
}
