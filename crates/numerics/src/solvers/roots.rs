//! A root of a function of one variable, found inside a bracket.

use crate::error::{self, ArgumentError};
use thiserror::Error;

/// The bracket is not narrowed below this multiple of its first width. A root at zero would otherwise need bisection through all exponents.
const FLOOR: f64 = 1e-30;
/// Evaluations after which the search stops. Bisection to [`FLOOR`] takes 100; this method needs at most three times as many.
const MAX_EVALUATIONS: usize = 400;

/// Why no root was found.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RootError {
    /// An end of the bracket or the tolerance is not usable.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The function has the same sign at both ends.
    #[error(
        "no sign change: f({lower}) = {at_lower}, f({upper}) = {at_upper}: expected one value on each side of zero"
    )]
    NotBracketed {
        /// Lower end of the bracket.
        lower: f64,
        /// Value at the lower end.
        at_lower: f64,
        /// Upper end of the bracket.
        upper: f64,
        /// Value at the upper end.
        at_upper: f64,
    },
    /// The function is NaN inside the bracket.
    #[error("f({at}) is NaN: expected a number")]
    NotANumber {
        /// Argument at which the value was NaN.
        at: f64,
    },
    /// The bracket did not become small enough.
    #[error("no root within {evaluations} evaluations: left with [{lower}, {upper}]")]
    NotConverged {
        /// Lower end of the remaining bracket.
        lower: f64,
        /// Upper end of the remaining bracket.
        upper: f64,
        /// Number of evaluations of the function.
        evaluations: usize,
    },
}

/// The root of `f` between `lower` and `upper`, where `f` has different signs, by Chandrupatla's method (1997): inverse
/// quadratic interpolation where three points support it, bisection elsewhere.
///
/// The result is within `tolerance` (in the unit of the argument) of a change of sign, or within four units in its last place, or, if the
/// root is next to zero, within 1e-30 of the bracket's width. `tolerance = 0.0` asks for the last two. Infinite values of `f` count
/// as signs.
///
/// ```
/// use fewbits_numerics::roots::bracketed;
/// let root = bracketed(|x| x * x - 2.0, 0.0, 2.0, 0.0)?;
/// assert!((root - std::f64::consts::SQRT_2).abs() < 1e-15);
/// # Ok::<(), fewbits_numerics::roots::RootError>(())
/// ```
///
/// # Errors
/// If `lower < upper` does not hold, an end is not finite, `tolerance` is negative, the signs at the ends are equal, `f` is NaN at a point
/// that is evaluated, or the bracket is still too wide after 400 evaluations (only pathological functions).
pub fn bracketed(mut f: impl FnMut(f64) -> f64, lower: f64, upper: f64, tolerance: f64) -> Result<f64, RootError> {
    error::finite("lower", lower)?;
    error::finite("upper", upper)?;
    error::non_negative("tolerance", tolerance)?;
    if lower >= upper {
        return Err(ArgumentError::new("lower", lower, format!("a number below upper = {upper}")).into());
    }
    let mut value = |x: f64| {
        let y = f(x);
        if y.is_nan() {
            Err(RootError::NotANumber { at: x })
        } else {
            Ok(y)
        }
    };
    // The root is between `a`, the newest point, and `b`; `c` is the point before.
    let (mut a, mut b) = (upper, lower);
    let (mut at_a, mut at_b) = (value(a)?, value(b)?);
    if at_a == 0.0 {
        return Ok(a);
    }
    if at_b == 0.0 {
        return Ok(b);
    }
    if (at_a > 0.0) == (at_b > 0.0) {
        return Err(RootError::NotBracketed {
            lower,
            at_lower: at_b,
            upper,
            at_upper: at_a,
        });
    }
    // Each end is halved before adding: the width of a bracket may exceed the largest number.
    let floor = FLOOR * (0.5 * upper - 0.5 * lower);
    let mut share = 0.5;
    for _ in 2..MAX_EVALUATIONS {
        let x = if share == 0.5 {
            0.5 * a + 0.5 * b
        } else {
            a + share * (b - a)
        };
        let y = value(x)?;
        let (c, at_c) = if (y > 0.0) == (at_a > 0.0) {
            (a, at_a)
        } else {
            let old = (b, at_b);
            (b, at_b) = (a, at_a);
            old
        };
        (a, at_a) = (x, y);
        let (best, at_best) = if at_a.abs() < at_b.abs() { (a, at_a) } else { (b, at_b) };
        let half = 0.5 * b - 0.5 * a;
        let reached = (2.0 * f64::EPSILON * best.abs()).max(tolerance).max(floor);
        if at_best == 0.0 || 2.0 * half.abs() <= reached {
            return Ok(best);
        }
        let xi = (a - b) / (c - b);
        let phi = (at_a - at_b) / (at_c - at_b);
        let interpolates = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
        share = if interpolates {
            let quadratic = at_a / (at_b - at_a) * at_c / (at_b - at_c)
                + (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b);
            // A step shorter than the tolerance might never cross the root, and the other end of the bracket would stay where it is.
            let shortest = (0.25 * reached / half.abs()).min(0.5);
            if quadratic.is_nan() {
                0.5
            } else {
                quadratic.clamp(shortest, 1.0 - shortest)
            }
        } else {
            0.5
        };
    }
    Err(RootError::NotConverged {
        lower: a.min(b),
        upper: a.max(b),
        evaluations: MAX_EVALUATIONS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_all_shapes_are_found_to_the_last_places() {
        type Case = (fn(f64) -> f64, f64, f64, f64, usize);
        let cases: [Case; 8] = [
            (|x| x * x - 2.0, 0.0, 2.0, std::f64::consts::SQRT_2, 12),
            (|x| x.exp() - 1e-3, -20.0, 5.0, -6.907_755_278_982_137, 15),
            (|x| x.tan(), 2.0, 4.0, std::f64::consts::PI, 12),
            (|x| if x < 0.3 { -1.0 } else { 1e9 }, 0.0, 1.0, 0.3, 57),
            (|x| (x - 1.0).powi(9), 0.0, 3.0, 1.0, 57),
            (|x| 1.0 / (x - 0.7), 0.0, 1.0, 0.7, 56),
            (|x| x * (-x * x).exp() + 1e-3 * x, -9.0, 10.0, 0.0, 16),
            (|x| x - 1e300, 0.0, 1.7e308, 1e300, 7),
        ];
        for (i, (f, lower, upper, truth, most)) in cases.into_iter().enumerate() {
            let mut calls = 0;
            let counted = |x: f64| {
                calls += 1;
                f(x)
            };
            let root = bracketed(counted, lower, upper, 0.0).unwrap();
            assert!(calls <= most, "case {i}: {calls} evaluations");
            // The ninth power is zero within rounding over 1e-35 or so; all others change sign at one number.
            assert!((root - truth).abs() <= 1e-15 * truth.abs().max(1e-14), "case {i}: {root:e}");
        }
    }

    #[test]
    fn the_unit_does_not_matter() {
        let count = |scale: f64| {
            let mut calls = 0;
            let f = |x: f64| {
                calls += 1;
                (x / scale).exp() - 3.0
            };
            let root = bracketed(f, -scale, 4.0 * scale, 0.0).unwrap() / scale;
            assert!((root - 3.0_f64.ln()).abs() < 1e-15);
            calls
        };
        assert_eq!(count(1.0), count(2.0_f64.powi(-40)));
        assert_eq!(count(1.0), count(2.0_f64.powi(40)));
        assert!(count(1.0) < 20);
    }

    #[test]
    fn what_is_no_bracket_is_refused() {
        assert!(matches!(bracketed(|x| x * x + 1.0, -1.0, 1.0, 0.0), Err(RootError::NotBracketed { .. })));
        assert!(matches!(bracketed(|x| x, 1.0, -1.0, 0.0), Err(RootError::Argument(_))));
        assert!(matches!(bracketed(|x| x, f64::NEG_INFINITY, 1.0, 0.0), Err(RootError::Argument(_))));
        assert!(matches!(bracketed(|x| x.sqrt() - 0.1, -1.0, 1.0, 0.0), Err(RootError::NotANumber { .. })));
        assert!(matches!(bracketed(|_| f64::NAN, -1.0, 1.0, 0.0), Err(RootError::NotANumber { .. })));
        assert_eq!(bracketed(|x| x, 0.0, 1.0, 0.0), Ok(0.0));
    }
}
