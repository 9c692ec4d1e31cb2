//! The probability of an interval ("cell") under the standard normal distribution, without branches.
//!
//! A cell whose middle is right of zero is first reflected to the left. Then one of three forms is used, none of which cancels:
//! - narrow cells (`width max(|middle|, 1) < 1`): `width phi(middle) S`, `S` a power series in the half width;
//! - cells left of zero: `exp(-upper^2/2) [T(|upper|) - T(|lower|) exp((upper^2 - lower^2)/2)]`;
//! - cells around zero: `1 - Phi(lower) - Phi(-upper)`.
//!
//! All three are computed and one is kept. The loop over a slice then has no branches and runs in vector registers.

use super::elementary::{exp_sum, half_square, ln_corrected, select};
use super::tail::scaled_tail;
use crate::constants::INV_SQRT_2PI;

/// Cells with `width max(|middle|, 1)` below this are summed as a series.
const NARROW: f64 = 1.0;
/// Terms of the series after the first; with [`NARROW`] the next is below 1e-17.
const TERMS: usize = 11;

/// `(2j - 1)/(2j + 1)` and `1/((2j + 2)(2j + 3))`: the recurrence of the series.
const SERIES: [(f64, f64); TERMS] = {
    let mut table = [(0.0, 0.0); TERMS];
    let mut j = 0;
    while j < TERMS {
        let n = 2.0 * j as f64;
        table[j] = ((n - 1.0) / (n + 1.0), 1.0 / ((n + 2.0) * (n + 3.0)));
        j += 1;
    }
    table
};

/// A probability in parts: `(mass + lost) exp(-(high + low))`.
struct Parts {
    mass: f64,
    lost: f64,
    high: f64,
    low: f64,
}

/// `S = int_{-1/2}^{1/2} exp(-w m u - w^2 u^2/2) du = sum_j He_2j(m) (w/2)^2j / (2j + 1)!`.
#[inline(always)]
fn series(middle: f64, half_width: f64) -> f64 {
    let square = half_width * half_width;
    let slope = middle * half_width;
    let (x, square_squared) = (slope * slope, square * square);
    let (mut before, mut term, mut rest) = (0.0, 1.0, 0.0);
    for (j, (ratio, reciprocal)) in SERIES.iter().enumerate() {
        let next = ((x - (4 * j + 1) as f64 * square) * term - ratio * square_squared * before) * reciprocal;
        rest += next;
        before = term;
        term = next;
    }
    1.0 + rest
}

/// A narrow cell.
#[inline(always)]
fn thin(lower: f64, upper: f64) -> Parts {
    let (width, sum) = (upper - lower, lower + upper);
    let middle = 0.5 * sum;
    // Two-sum: what rounding took from the middle matters once its square is in the exponent.
    let virtual_lower = sum - upper;
    let middle_lost = 0.5 * ((lower - virtual_lower) + (upper - (sum - virtual_lower)));
    let (high, low) = half_square(middle);
    Parts {
        mass: INV_SQRT_2PI * width * series(middle, 0.5 * width),
        lost: 0.0,
        high,
        low: low + middle * middle_lost,
    }
}

/// `WIDE`: the caller guarantees `b - a >= 1`, and the series for narrow cells is left out. `ALONE`: only the form that is kept is
/// computed, by branches. Both give the same bits as `<false, false>`.
#[inline(always)]
fn parts<const WIDE: bool, const ALONE: bool>(a: f64, b: f64) -> Parts {
    let leans_right = a + b > 0.0;
    let (lower, upper) = (select(leans_right, -b, a), select(leans_right, -a, b));
    let (width, sum) = (upper - lower, lower + upper);
    // |middle| = -middle here, and 1 where that is less.
    let steepness = select(sum < -2.0, -0.5 * sum, 1.0);
    let narrow = !WIDE && width * steepness < NARROW;
    if ALONE && narrow {
        return thin(lower, upper);
    }
    let left = upper <= 0.0;
    let (near, far) = (scaled_tail(upper.abs()), scaled_tail(lower.abs()));
    let (lower_high, lower_low) = half_square(lower);
    let (upper_high, upper_low) = half_square(upper);
    let far_decay = exp_sum(select(left, 0.5 * width * sum, -lower_high), select(left, 0.0, -lower_low));
    let near_decay = if ALONE && left {
        0.0
    } else {
        exp_sum(-upper_high, -upper_low)
    };
    let outside = far * far_decay + near * near_decay;
    let rest = 1.0 - outside;
    let wide = Parts {
        mass: select(left, near - far * far_decay, rest),
        lost: select(left, 0.0, (1.0 - rest) - outside),
        high: select(left, upper_high, 0.0),
        low: select(left, upper_low, 0.0),
    };
    if WIDE || ALONE {
        return wide;
    }
    let thin = thin(lower, upper);
    Parts {
        mass: select(narrow, thin.mass, wide.mass),
        lost: select(narrow, thin.lost, wide.lost),
        high: select(narrow, thin.high, wide.high),
        low: select(narrow, thin.low, wide.low),
    }
}

/// Least width of a cell for the functions `*_wide`: one, and a margin for rounding of the edges.
pub const WIDE: f64 = 1.0 + 1e-9;

/// `ln(Phi(b) - Phi(a))`; `-inf` for `a >= b`. Error at most eight units in the last place if `a` and `b` are exact.
#[inline(always)]
pub fn log_interval(a: f64, b: f64) -> f64 {
    log_interval_of::<false, false>(a, b)
}

/// As [`log_interval`], with the same bits. Precondition: `b - a` is at least [`WIDE`] before rounding; skips the series for narrow cells.
#[inline(always)]
pub(crate) fn log_interval_wide(a: f64, b: f64) -> f64 {
    log_interval_of::<true, false>(a, b)
}

#[inline(always)]
pub(crate) fn log_interval_of<const WIDE: bool, const ALONE: bool>(a: f64, b: f64) -> f64 {
    let Parts { mass, lost, high, low } = parts::<WIDE, ALONE>(a, b);
    let low = select(high == f64::INFINITY, 0.0, low);
    let value = ln_corrected(mass, lost * (2.0 - mass)) - (high + low);
    select(a >= b, f64::NEG_INFINITY, value)
}

/// `Phi(b) - Phi(a)`; 0 for `a >= b`. Error at most ten units in the last place if `a` and `b` are exact.
#[inline(always)]
pub fn interval(a: f64, b: f64) -> f64 {
    interval_of::<false, false>(a, b)
}

/// As [`interval`], with the same bits. Precondition: `b - a` is at least [`WIDE`] before rounding; skips the series for narrow cells.
#[inline(always)]
pub(crate) fn interval_wide(a: f64, b: f64) -> f64 {
    interval_of::<true, false>(a, b)
}

#[inline(always)]
pub(crate) fn interval_of<const WIDE: bool, const ALONE: bool>(a: f64, b: f64) -> f64 {
    let Parts { mass, high, low, .. } = parts::<WIDE, ALONE>(a, b);
    select(a >= b, 0.0, mass * exp_sum(-high, -low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_cells_have_the_same_bits() {
        for i in -4000..4000 {
            let a = 1e-3 * f64::from(i) + 1e-4 * f64::from(i).powi(3).cbrt().sin();
            for a in [a, 10.0 * a, 1e3 * a, 1e14 * a] {
                for width in [WIDE, 1.3, 2.0, 7.0, 60.0] {
                    assert_eq!(log_interval(a, a + width).to_bits(), log_interval_wide(a, a + width).to_bits());
                    assert_eq!(interval(a, a + width).to_bits(), interval_wide(a, a + width).to_bits());
                }
            }
        }
    }
}
