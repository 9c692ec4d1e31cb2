//! Moments and draws of a standard normal variable that is known to be in an interval ("cell").

use super::{INV_SQRT_2PI, cdf, log_pdf, quantile};
use crate::error::ArgumentError;
use crate::kernels;
use crate::kernels::tail::cut;
use crate::quadrature::gauss_legendre;
use rand::distr::Open01;
use rand::{Rng, RngExt};

/// Probability of a cell under `N(0, 1)`, and mean and variance of the variable given the cell.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TruncatedMoments {
    /// `ln P(lower <= X < upper)`.
    pub log_probability: f64,
    /// `E[X | lower <= X < upper]`, inside the closed cell.
    pub mean: f64,
    /// `Var[X | lower <= X < upper]`, in `(0, 1]`.
    pub variance: f64,
}

/// The closed form of the variance needs a cell at least this wide ...
const CLOSED_FORM_WIDTH: f64 = 0.5;
/// ... whose edge nearest zero is at most this far from zero. Otherwise the closed form cancels.
const CLOSED_FORM_EDGE: f64 = 5.0;
/// Width, in multiples of the distance over which the density falls by `e`, beyond which the rest of an unbounded cell is below rounding.
const CUT: f64 = 48.0;

/// Moments of `N(0, 1)` restricted to `[lower, upper)`; either end may be infinite.
///
/// With `Z = Phi(b) - Phi(a)`: mean `(phi(a) - phi(b))/Z`, variance `1 + (a phi(a) - b phi(b))/Z - mean^2`. For narrow or
/// far cells these formulas cancel. There the moments are computed by Gauss-Legendre quadrature with at most 64 nodes, with the density
/// divided by its value at the edge nearest zero. Relative error of the variance below 1e-12.
///
/// # Errors
/// If `lower < upper` does not hold (NaN included).
pub fn truncated_moments(lower: f64, upper: f64) -> Result<TruncatedMoments, ArgumentError> {
    let ordered = lower < upper;
    if !ordered || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
        return Err(ArgumentError::new("cell", format!("[{lower}, {upper})"), "lower < upper"));
    }
    // Cells left of zero are mirrored, so that mirrored cells have mirrored moments to the last bit.
    if lower + upper < 0.0 {
        let mirrored = leaning_right(-upper, -lower);
        Ok(TruncatedMoments {
            mean: -mirrored.mean,
            ..mirrored
        })
    } else {
        Ok(leaning_right(lower, upper))
    }
}

/// Cells whose middle is at zero or right of it.
fn leaning_right(lower: f64, upper: f64) -> TruncatedMoments {
    if lower >= 0.0 {
        right_moments(lower, upper)
    } else if upper - lower > CLOSED_FORM_WIDTH {
        closed_form(lower, upper)
    } else {
        by_quadrature(lower, upper - lower)
    }
}

/// Cells with `0 <= lower`.
fn right_moments(lower: f64, upper: f64) -> TruncatedMoments {
    if upper - lower > CLOSED_FORM_WIDTH && lower <= CLOSED_FORM_EDGE {
        closed_form(lower, upper)
    } else {
        // The width is limited, not the upper end: for large `lower`, `lower + CUT / lower` rounds to `lower`.
        by_quadrature(lower, (upper - lower).min(CUT / lower.max(1.0)))
    }
}

fn closed_form(lower: f64, upper: f64) -> TruncatedMoments {
    let (near, far) = (cut(lower), cut(upper));
    // Densities and `Z` are divided by exp(-lower^2 / 2) if the cell's probability is proportional to it; they do not underflow then.
    let (unit, decay, mass, log_probability) = if lower >= 0.0 {
        let decay = far.decay / near.decay;
        let mass = near.scaled - far.scaled * decay;
        (1.0, decay, mass, kernels::scalar::ln(mass) - 0.5 * lower * lower)
    } else {
        let outside = near.outside + far.outside;
        (near.decay, far.decay, 1.0 - outside, (-outside).ln_1p())
    };
    let times = |edge: f64, density: f64| if density > 0.0 { edge * density } else { 0.0 };
    let (at_lower, at_upper) = (INV_SQRT_2PI * unit / mass, INV_SQRT_2PI * decay / mass);
    let mean = at_lower - at_upper;
    TruncatedMoments {
        log_probability,
        mean,
        variance: 1.0 + times(lower, at_lower) - times(upper, at_upper) - mean * mean,
    }
}

/// Width of a cell over which the density is constant to rounding and the variance underflows.
const POINT: f64 = 1e-160;

/// The cell `[lower, lower + width)`.
fn by_quadrature(lower: f64, width: f64) -> TruncatedMoments {
    if width < POINT {
        return TruncatedMoments {
            log_probability: log_pdf(lower) + width.ln(),
            mean: lower + 0.5 * width,
            variance: 0.0,
        };
    }
    // Where the density changes by less than a factor of 8, sixteen nodes are exact to rounding.
    let rule = if width * (lower.abs() + width) < 2.0 {
        gauss_legendre::<16>()
    } else {
        gauss_legendre::<64>()
    };
    // Offsets from the lower edge keep the digits of a narrow cell.
    let mut densities = [0.0; 64];
    let densities = &mut densities[..rule.nodes().len()];
    for (density, (t, _)) in densities.iter_mut().zip(rule.on(0.0, width)) {
        *density = -t * (lower + 0.5 * t);
    }
    kernels::exp(densities);
    let (mut mass, mut first) = (0.0, 0.0);
    for (density, (t, w)) in densities.iter_mut().zip(rule.on(0.0, width)) {
        *density *= w;
        mass += *density;
        first += *density * t;
    }
    let centre = first / mass;
    let second: f64 = densities
        .iter()
        .zip(rule.on(0.0, width))
        .map(|(p, (t, _))| p * (t - centre) * (t - centre))
        .sum();
    TruncatedMoments {
        log_probability: log_pdf(lower) + mass.ln(),
        mean: lower + centre,
        variance: second / mass,
    }
}

/// If the edge nearest zero is farther out than this, rejection from an exponential proposal is used in place of inversion.
const REJECTION_EDGE: f64 = 8.0;

/// Draws from `N(0, 1)` restricted to `[lower, upper]`; either end may be infinite. If `lower = upper` this number is returned.
///
/// Inverts the distribution function in the tail where it is accurate; beyond eight standard deviations an exponential
/// proposal at the inner edge is accepted with probability above 0.98 (Robert 1995).
///
/// # Errors
/// If the cell is empty: `lower > upper`, an end that is NaN, or both ends the same infinity.
pub fn sample_truncated<R: Rng + ?Sized>(rng: &mut R, lower: f64, upper: f64) -> Result<f64, ArgumentError> {
    let ordered = lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
    if !ordered {
        return Err(ArgumentError::new(
            "cell",
            format!("[{lower}, {upper}]"),
            "lower <= upper, a finite number between",
        ));
    }
    if lower == upper {
        return Ok(lower);
    }
    Ok(if lower + upper > 0.0 || upper == f64::INFINITY {
        -sample_left(rng, -upper, -lower)
    } else {
        sample_left(rng, lower, upper)
    })
}

/// Cells whose bulk lies left of zero.
fn sample_left<R: Rng + ?Sized>(rng: &mut R, lower: f64, upper: f64) -> f64 {
    if upper < -REJECTION_EDGE {
        let edge = -upper;
        let width = upper - lower;
        // The proposal is restricted to the cell, so that no draw is outside.
        let inside = -(-edge * width).exp_m1();
        loop {
            let t = -(-rng.random::<f64>() * inside).ln_1p() / edge;
            if rng.random::<f64>() <= (-0.5 * t * t).exp() {
                return (upper - t).max(lower);
            }
        }
    }
    let (from, to) = (cdf(lower), cdf(upper));
    // The uniform number is from an open interval: zero would give minus infinity in an unbounded cell.
    let u: f64 = rng.sample(Open01);
    quantile(from + u * (to - from)).clamp(lower, upper)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// A generator stuck at one word.
    struct Stuck(u64);

    impl rand::TryRng for Stuck {
        type Error = Infallible;

        fn try_next_u32(&mut self) -> Result<u32, Infallible> {
            Ok(self.0 as u32)
        }

        fn try_next_u64(&mut self) -> Result<u64, Infallible> {
            Ok(self.0)
        }

        fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
            bytes.fill(self.0 as u8);
            Ok(())
        }
    }

    #[test]
    fn cells_without_a_number_are_refused_at_once() {
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        for (lower, upper) in [
            (nan, -9.0),
            (nan, 1.0),
            (-9.0, nan),
            (nan, nan),
            (inf, inf),
            (-inf, -inf),
            (1.0, 0.0),
            (inf, -inf),
        ] {
            assert!(sample_truncated(&mut Stuck(0), lower, upper).is_err(), "[{lower}, {upper}]");
        }
        assert_eq!(sample_truncated(&mut Stuck(0), -9.5, -9.5), Ok(-9.5));
    }

    #[test]
    fn extreme_uniform_numbers_give_finite_draws_inside() {
        let inf = f64::INFINITY;
        let cells = [
            (-inf, inf),
            (-inf, -3.0),
            (2.0, inf),
            (-inf, 40.0),
            (-40.0, inf),
            (-1e300, 1.0),
            (-0.1, 1e300),
        ];
        for word in [0, u64::MAX] {
            for (lower, upper) in cells {
                let x = sample_truncated(&mut Stuck(word), lower, upper).unwrap();
                assert!(x.is_finite() && (lower..=upper).contains(&x), "{x} in [{lower}, {upper}]");
            }
        }
        for (lower, upper) in [(-inf, -9.0), (30.0, inf), (1e200, inf), (-1e9, -1e9 + 1.0)] {
            let x = sample_truncated(&mut Stuck(0), lower, upper).unwrap();
            assert!(x.is_finite() && (lower..=upper).contains(&x), "{x} in [{lower}, {upper}]");
        }
    }
}
