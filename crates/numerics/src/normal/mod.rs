//! The standard normal distribution, exact in its tails.
//!
//! Everything a one-bit or censored sensor says is a statement about a normal variable falling in an interval, often a far
//! or a narrow one. Written naively, `1 - cdf`, `pdf / cdf` and `cdf(b) - cdf(a)` lose every digit there, so this module is
//! the only place in the workspace where such quantities are formed. Probabilities of intervals live in the log domain.
//!
//! | quantity | function | exact in |
//! |---|---|---|
//! | `ln Phi(x)` | [`log_cdf`] | both tails |
//! | `ln(Phi(b) - Phi(a))` | [`log_interval`] | both tails, narrow and wide |
//! | `phi(x) / Phi(x)` | [`inverse_mills`] | both tails |
//! | mean and variance beyond a one-sided cut | [`one_sided`], [`one_sided_variance`] | both tails |
//! | mean and variance in a cell | [`truncated_moments`] | narrow, far and unbounded cells |
//! | a draw from a cell | [`sample_truncated`] | the same |
//! | `P(a < (X, Y) < b)` | [`bivariate_rectangle`] | every correlation, far rectangles |
//!
//! ```
//! use fewbits_numerics::normal;
//! // Forty standard deviations out the probability underflows; its logarithm does not.
//! assert_eq!(normal::cdf(-40.0), 0.0);
//! assert!((normal::log_cdf(-40.0) + 804.608_442_013_754).abs() < 1e-9);
//! ```
//!
//! Arguments are plain `f64` and are not checked: NaN in gives NaN out, infinities are meant.

mod bivariate;
mod erfcx;
mod one_sided;
mod truncated;

pub use bivariate::bivariate_rectangle;
pub use erfcx::erfcx;
pub use one_sided::{OneSided, one_sided, one_sided_variance};
pub use truncated::{TruncatedMoments, sample_truncated, truncated_moments};

use crate::quadrature::gauss_legendre;
use std::f64::consts::{FRAC_1_SQRT_2, LN_2};

/// `1 / sqrt(2 pi)`.
pub const INV_SQRT_2PI: f64 = 0.398_942_280_401_432_7;
/// `ln sqrt(2 pi)`.
pub const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_7;
/// `sqrt(2 / pi)`, the gain of a sign bit at its threshold.
pub const SQRT_2_OVER_PI: f64 = 0.797_884_560_802_865_4;

/// Density `phi(x) = exp(-x^2/2) / sqrt(2 pi)`.
#[inline]
pub fn pdf(x: f64) -> f64 {
    INV_SQRT_2PI * (-0.5 * x * x).exp()
}

/// `ln phi(x)`.
#[inline]
pub fn log_pdf(x: f64) -> f64 {
    -0.5 * x * x - LN_SQRT_2PI
}

/// `ln N(x; mean, variance)` for `variance > 0`.
#[inline]
pub fn log_pdf_with(x: f64, mean: f64, variance: f64) -> f64 {
    let d = x - mean;
    -0.5 * d * d / variance - 0.5 * variance.ln() - LN_SQRT_2PI
}

/// Distribution function `Phi(x)`, accurate in the left tail up to the rounding of `x` itself (relative error below
/// `(4 + x^2) 2^-53`). The right tail is `cdf(-x)`.
#[inline]
pub fn cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// `ln Phi(x)`, finite for every finite `x`.
#[inline]
pub fn log_cdf(x: f64) -> f64 {
    if x <= 0.0 {
        if x == f64::NEG_INFINITY {
            return x;
        }
        erfcx(-x * FRAC_1_SQRT_2).ln() - LN_2 - 0.5 * x * x
    } else {
        (-cdf(-x)).ln_1p()
    }
}

/// Quantile `Phi^-1(p)` for `p` in `[0, 1]`; infinite at the ends, NaN outside.
pub fn quantile(p: f64) -> f64 {
    if p.is_nan() || !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if p == 0.0 {
        return f64::NEG_INFINITY;
    }
    if p == 1.0 {
        return f64::INFINITY;
    }
    // Above the median p itself limits the accuracy, and 1 - p is exact there.
    if p > 0.5 {
        return -left_quantile(1.0 - p);
    }
    left_quantile(p)
}

fn left_quantile(p: f64) -> f64 {
    let x = -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * p);
    // One Newton step on ln Phi settles the last digits of the rational start.
    x - (log_cdf(x) - p.ln()) / inverse_mills(x)
}

/// Intervals narrower than this, measured in local decay lengths, are integrated instead of differenced.
const NARROW: f64 = 1.0;

/// `Phi(b) - Phi(a)` for `a <= b`, accurate relative to itself; 0 for `a >= b`.
#[inline]
pub fn interval(a: f64, b: f64) -> f64 {
    if a >= b {
        return 0.0;
    }
    if a <= 0.0 && b >= 0.0 {
        return 0.5 * (libm::erf(b * FRAC_1_SQRT_2) + libm::erf(-a * FRAC_1_SQRT_2));
    }
    let (a, b) = if a > 0.0 { (-b, -a) } else { (a, b) };
    (-0.5 * b * b).exp() * scaled_left_interval(a, b)
}

/// `ln(Phi(b) - Phi(a))` for `a < b`, exact in both tails and for narrow intervals; `-inf` for `a >= b`.
///
/// Intervals around zero add two error functions of positive terms. Elsewhere the interval is reflected to the left tail and
/// the factor `exp(-b^2/2)` of its inner edge is taken out; what remains is a difference of [`erfcx`] values or, where
/// these would cancel, a Gauss-Legendre sum.
#[inline]
pub fn log_interval(a: f64, b: f64) -> f64 {
    if a >= b {
        return f64::NEG_INFINITY;
    }
    if a <= 0.0 && b >= 0.0 {
        if a < -1.0 && b > 1.0 {
            return (-(cdf(a) + cdf(-b))).ln_1p();
        }
        return (0.5 * (libm::erf(b * FRAC_1_SQRT_2) + libm::erf(-a * FRAC_1_SQRT_2))).ln();
    }
    let (a, b) = if a > 0.0 { (-b, -a) } else { (a, b) };
    if b == f64::NEG_INFINITY {
        return b;
    }
    scaled_left_interval(a, b).ln() - 0.5 * b * b
}

/// `(Phi(b) - Phi(a)) exp(b^2/2)` for `a < b <= 0`.
#[inline]
fn scaled_left_interval(a: f64, b: f64) -> f64 {
    let width = b - a;
    if width * (-b).max(1.0) < NARROW {
        let sum = gauss_legendre::<12>().sum(0.0, width, |t| (t * (b - 0.5 * t)).exp());
        INV_SQRT_2PI * sum
    } else {
        let near = erfcx(-b * FRAC_1_SQRT_2);
        if a == f64::NEG_INFINITY {
            return 0.5 * near;
        }
        let far = erfcx(-a * FRAC_1_SQRT_2) * (0.5 * width * (a + b)).exp();
        0.5 * (near - far)
    }
}

/// Inverse Mills ratio `phi(x) / Phi(x)`, positive and decreasing; `~ -x` in the left tail.
#[inline]
pub fn inverse_mills(x: f64) -> f64 {
    if x <= 0.0 {
        SQRT_2_OVER_PI / erfcx(-x * FRAC_1_SQRT_2)
    } else {
        pdf(x) / cdf(x)
    }
}
