//! The standard normal distribution, accurate in its tails.
//!
//! A report of a one-bit or censored sensor says that a normal variable is in an interval, often a narrow one or one far from the mean. The
//! formulas `1 - cdf`, `pdf / cdf` and `cdf(b) - cdf(a)` lose all digits there. Only this module computes such quantities; the rest
//! of the workspace calls it. Probabilities of intervals are returned as logarithms.
//!
//! | quantity | function | accurate in |
//! |---|---|---|
//! | `ln Phi(x)` | [`log_cdf`] | both tails |
//! | `ln(Phi(b) - Phi(a))` | [`log_interval`] | both tails, narrow and wide |
//! | `phi(x) / Phi(x)` | [`inverse_mills`] | both tails |
//! | mean and variance beyond a one-sided cut | [`one_sided`] | both tails |
//! | mean and variance in a cell | [`truncated_moments`] | narrow, far and unbounded cells |
//! | a draw from a cell | [`sample_truncated`] | narrow, far and unbounded cells |
//!
//! Arguments are plain `f64` and are not checked: NaN gives NaN, and infinities are allowed. [`kernels`](crate::kernels) has the same
//! functions over slices, with the same bits, and states their largest errors.

mod one_sided;
mod quantile;
mod truncated;

pub use one_sided::{OneSided, one_sided};
pub use quantile::quantile;
pub use truncated::{TruncatedMoments, sample_truncated, truncated_moments};

use crate::kernels::cell::{interval_of, log_interval_of};
use crate::kernels::elementary::{ln_corrected, ln_one_minus};
use crate::kernels::scalar;
use crate::kernels::tail::{cut, scaled_tail};

pub use crate::constants::{INV_SQRT_2PI, LN_SQRT_2PI};
/// `sqrt(2 / pi)`: mean of a standard normal variable known to be positive. It is the gain of a sign bit whose threshold is the mean.
pub const SQRT_2_OVER_PI: f64 = 0.797_884_560_802_865_4;

/// Density `phi(x) = exp(-x^2/2) / sqrt(2 pi)`.
pub fn pdf(x: f64) -> f64 {
    scalar::pdf(x)
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

/// `erfcx(x) = exp(x^2) erfc(x)`, within six units in the last place for arguments of either sign.
///
/// Positive and decreasing; `+inf` below `x = -26.62`, `~ 1/(x sqrt(pi))` for large `x`. NaN in, NaN out.
#[inline]
pub fn erfcx(x: f64) -> f64 {
    // The same bits as the branch-free form, without computing the forms that it discards.
    if x >= 0.0 {
        2.0 * scaled_tail(std::f64::consts::SQRT_2 * x)
    } else {
        scalar::erfcx(x)
    }
}

/// Distribution function `Phi(x)`, within six units in the last place, the left tail included. The right tail is `cdf(-x)`.
pub fn cdf(x: f64) -> f64 {
    scalar::cdf(x)
}

/// `ln Phi(x)`, within six units in the last place; finite down to `x = -1.8e154`, where the square overflows.
pub fn log_cdf(x: f64) -> f64 {
    // The same bits as the branch-free form, without computing the forms that it discards.
    if x <= 0.0 {
        ln_corrected(scaled_tail(-x), 0.0) - 0.5 * x * x
    } else {
        ln_one_minus(cut(x).outside)
    }
}

/// `Phi(b) - Phi(a)` for `a <= b`, with a small relative error; 0 for `a >= b`.
pub fn interval(a: f64, b: f64) -> f64 {
    interval_of::<false, true>(a, b)
}

/// `ln(Phi(b) - Phi(a))` for `a < b`, accurate in both tails and for narrow intervals; `-inf` for `a >= b`.
///
/// Around zero the probability is one minus the two tails. Elsewhere the interval is reflected to the left tail and `exp(-b^2/2)` of its
/// edge nearest zero is factored out. What remains is the difference of two scaled tails or, if these would cancel, a power series around
/// the middle of the interval.
pub fn log_interval(a: f64, b: f64) -> f64 {
    log_interval_of::<false, true>(a, b)
}

/// Inverse Mills ratio `phi(x) / Phi(x)`, positive and decreasing; `~ -x` in the left tail.
pub fn inverse_mills(x: f64) -> f64 {
    if x <= 0.0 {
        INV_SQRT_2PI / scaled_tail(-x)
    } else {
        cut(x).inverse_mills(x)
    }
}
