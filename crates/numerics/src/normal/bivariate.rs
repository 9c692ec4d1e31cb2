//! Rectangle probabilities of two correlated normal variables.

use super::{interval, log_interval};
use crate::error::{self, ArgumentError};
use crate::kernels::elementary::exp;
use crate::quadrature::gauss_legendre;

/// Beyond this the density underflows.
const REACH: f64 = 39.0;
/// Logarithmic drop from the peak of the integrand beyond which nothing is left.
const DROP: f64 = 60.0;
/// Two rules that agree to this share of the whole are right.
const AGREEMENT: f64 = 1e-13;
/// Halvings of one panel; a log-concave integrand needs about ten.
const DEEPEST: usize = 40;

/// `P(lower[0] < X < upper[0], lower[1] < Y < upper[1])` for standard normal `X`, `Y` with correlation `rho`.
///
/// Integrates `phi(x) [Phi((u - rho x)/s) - Phi((l - rho x)/s)]`, `s = sqrt(1 - rho^2)`. The integrand is log-concave
/// (Prekopa), so its peak and the interval that holds its mass are found first, in the log domain, and Gauss-Legendre panels
/// are halved there until two rules agree. Relative error below 1e-11 for probabilities down to the smallest normal number,
/// for all correlations up to `1 - 1e-9`; beyond that the problem itself magnifies the rounding of `rho`. `|rho| = 1` is the
/// interval that remains on the diagonal.
///
/// # Errors
/// If `rho` is outside `[-1, 1]` or an edge is NaN. Empty rectangles have probability 0.
pub fn bivariate_rectangle(lower: [f64; 2], upper: [f64; 2], rho: f64) -> Result<f64, ArgumentError> {
    error::within("rho", rho, -1.0, 1.0)?;
    for edge in lower.iter().chain(&upper) {
        if edge.is_nan() {
            return Err(ArgumentError::new("edge", edge, "a number or an infinity"));
        }
    }
    if lower[0] >= upper[0] || lower[1] >= upper[1] {
        return Ok(0.0);
    }
    // A negative correlation is the reflected rectangle.
    let (l, u) = if rho < 0.0 {
        (-upper[1], -lower[1])
    } else {
        (lower[1], upper[1])
    };
    let rho = rho.abs();
    if rho == 1.0 {
        return Ok(interval(lower[0].max(l), upper[0].min(u)));
    }
    let (from, to) = (lower[0].max(-REACH), upper[0].min(REACH));
    if from >= to {
        return Ok(0.0);
    }
    let s = ((1.0 - rho) * (1.0 + rho)).sqrt();
    let standardised = |edge: f64, x: f64| {
        // Near correlation one `rho x` would lose what `edge - x` keeps.
        let distance = if rho > 0.5 {
            (edge - x) + (1.0 - rho) * x
        } else {
            edge - rho * x
        };
        distance / s
    };
    let log_integrand = |x: f64| log_interval(standardised(l, x), standardised(u, x)) - 0.5 * x * x;

    let peak = peak(&log_integrand, from, to);
    let top = log_integrand(peak);
    if top == f64::NEG_INFINITY {
        return Ok(0.0);
    }
    let left = fall(&log_integrand, peak, from, top - DROP);
    let right = fall(&log_integrand, peak, to, top - DROP);
    let integrand = |x: f64| exp(log_integrand(x) - top);
    let rough = coarse(&integrand, left, peak) + coarse(&integrand, peak, right);
    let whole = halved(&integrand, left, peak, rough, DEEPEST) + halved(&integrand, peak, right, rough, DEEPEST);
    Ok(whole * exp(top) * super::INV_SQRT_2PI)
}

/// Where a concave function is largest on `[from, to]`, to about a thousandth of the way to where it has dropped by one.
fn peak(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (from, to);
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    // Seventy steps leave 1e-13 of the interval: less than the narrowest step of the bracket.
    for _ in 0..70 {
        if at_a >= at_b {
            high = b;
            (b, at_b) = (a, at_a);
            a = high - RATIO * (high - low);
            at_a = f(a);
        } else {
            low = a;
            (a, at_a) = (b, at_b);
            b = low + RATIO * (high - low);
            at_b = f(b);
        }
    }
    // At the ends the open search stays short of the edge.
    [from, to, a]
        .into_iter()
        .fold(a, |best, x| if f(x) > f(best) { x } else { best })
}

/// The point between `peak` and `end` where a concave function has fallen to `level`, or `end` if it has not.
fn fall(f: &impl Fn(f64) -> f64, peak: f64, end: f64, level: f64) -> f64 {
    if f(end) >= level {
        return end;
    }
    let (mut inside, mut outside) = (peak, end);
    // Doubling first: the mass may hold a billionth of the way.
    let mut share = 1e-12;
    while share < 1.0 {
        let x = peak + share * (end - peak);
        if f(x) < level {
            outside = x;
            break;
        }
        inside = x;
        share *= 4.0;
    }
    for _ in 0..8 {
        let middle = 0.5 * (inside + outside);
        if f(middle) < level {
            outside = middle;
        } else {
            inside = middle;
        }
    }
    outside
}

fn coarse(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    gauss_legendre::<20>().sum(from, to, f)
}

/// Integral by halving until the parts agree with the whole, relative to the integral sought.
fn halved(f: &impl Fn(f64) -> f64, from: f64, to: f64, scale: f64, depth: usize) -> f64 {
    let whole = coarse(f, from, to);
    let middle = 0.5 * (from + to);
    let parts = coarse(f, from, middle) + coarse(f, middle, to);
    if depth == 0 || (whole - parts).abs() <= AGREEMENT * scale.max(parts) {
        return parts;
    }
    halved(f, from, middle, scale, depth - 1) + halved(f, middle, to, scale, depth - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn the_fall_of_a_parabola_is_where_it_should_be() {
        for width in [1e-9, 3e-4, 0.7, 2.9] {
            for end in [38.6, -37.3] {
                for peak in [0.0, 0.4] {
                    let calls = Cell::new(0);
                    let f = |x: f64| {
                        calls.set(calls.get() + 1);
                        1.3 - 0.5 * ((x - peak) / width).powi(2)
                    };
                    let (got, want) = ((fall(&f, peak, end, 1.3 - DROP) - peak) / width, 120_f64.sqrt().copysign(end));
                    assert!((1.0..1.02).contains(&(got / want)), "{width} {end}: {got}");
                    assert!(calls.get() <= 32, "{}", calls.get());
                }
            }
        }
        // Nothing has fallen by the end, or all of it only at the end.
        assert_eq!(fall(&|x: f64| -x, 0.4, 38.6, -DROP), 38.6);
        let last = fall(&|x: f64| if x < 38.5 { 0.0 } else { -100.0 }, 0.4, 38.6, -DROP);
        assert!((38.5..38.9).contains(&last), "{last}");
    }

    #[test]
    fn the_peak_is_found_inside_and_at_the_ends() {
        for (at, width) in [(0.37, 1.0), (-11.2, 0.03), (38.9, 1e-6)] {
            let got = peak(&|x: f64| -((x - at) / width).powi(2), -39.0, 39.0);
            assert!((got - at).abs() < 1e-3 * width, "{got} for {at}");
        }
        assert_eq!(peak(&|x: f64| 3.0 * x, -1.3, 2.7), 2.7);
        assert_eq!(peak(&|x: f64| -3.0 * x, -1.3, 2.7), -1.3);
    }

    #[test]
    fn panels_are_halved_only_where_they_must() {
        for (width, most) in [(1.0, 180), (0.01, 900)] {
            let calls = Cell::new(0);
            let f = |x: f64| {
                calls.set(calls.get() + 1);
                (-0.5 * ((x - 0.3) / width).powi(2)).exp()
            };
            let whole = (std::f64::consts::TAU).sqrt() * width;
            let got = halved(&f, 0.3, 9.9, whole, DEEPEST);
            assert!((got / whole - 0.5).abs() < 1e-13, "{width}: {got}");
            assert!(calls.get() <= most, "{width}: {}", calls.get());
        }
    }
}
