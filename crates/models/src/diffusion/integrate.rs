//! Adaptive quadrature of smooth integrands.

use fewbits_numerics::quadrature::gauss_legendre;

/// Largest number of times that an interval is halved.
const DEEPEST: u32 = 40;

/// `int_a^b f`, with an error of about `relative` times the integral of `|f|`: 16-point Gauss-Legendre panels, halved until the sum over
/// two halves agrees with the whole.
pub(super) fn integrate(f: &impl Fn(f64) -> f64, a: f64, b: f64, relative: f64) -> f64 {
    let rule = gauss_legendre::<16>();
    let whole = rule.composite(a, b, 4, f);
    let scale = rule.composite(a, b, 4, |x| f(x).abs());
    halve(f, a, b, whole, relative * scale.max(f64::MIN_POSITIVE), DEEPEST)
}

fn halve(f: &impl Fn(f64) -> f64, a: f64, b: f64, whole: f64, tolerance: f64, depth: u32) -> f64 {
    let middle = 0.5 * (a + b);
    let rule = gauss_legendre::<16>();
    let (left, right) = (rule.sum(a, middle, f), rule.sum(middle, b, f));
    let apart = (left + right - whole).abs();
    // A NaN cannot be improved by halving.
    if depth == 0 || apart <= tolerance || apart.is_nan() {
        return left + right;
    }
    halve(f, a, middle, left, tolerance, depth - 1) + halve(f, middle, b, right, tolerance, depth - 1)
}
