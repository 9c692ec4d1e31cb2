//! Adaptive quadrature over the age of a release.

use fewbits_numerics::quadrature::gauss_legendre;

/// Largest number of times that an interval is halved.
const MAX_DEPTH: u32 = 40;

/// Where `-ln` of an exponential exceeds this, the exponential is zero.
const UNDERFLOW: f64 = 745.0;
/// Aim of the relative error, a tenth of what the callers promise.
const RELATIVE: f64 = 1e-13;

/// `int_0^longest f(age) d age` for an `f` that falls as `exp(-distance^2 / (4 diffusivity age))` at small ages.
///
/// Computed in `u = age^(-1/2)`, in which such functions are smooth: `d age = 2 age / u du`.
pub(super) fn over_ages(diffusivity: f64, distance: f64, longest: f64, f: impl Fn(f64) -> f64) -> f64 {
    // For larger u the exponential underflows to zero.
    let (first, last) = (longest.sqrt().recip(), (4.0 * diffusivity * UNDERFLOW).sqrt() / distance);
    if first >= last {
        return 0.0;
    }
    let integrand = |u: f64| {
        let age = (u * u).recip();
        2.0 * f(age) * age / u
    };
    integrate(&integrand, first, last, RELATIVE)
}

/// `int_a^b f`, with an error of about `relative` times the integral of `|f|`: 16-point Gauss-Legendre panels, halved until the sum over
/// two halves agrees with the whole.
fn integrate(f: &impl Fn(f64) -> f64, a: f64, b: f64, relative: f64) -> f64 {
    let rule = gauss_legendre::<16>();
    let whole = rule.composite(a, b, 4, f);
    let scale = rule.composite(a, b, 4, |x| f(x).abs());
    halve(f, a, b, whole, relative * scale.max(f64::MIN_POSITIVE), MAX_DEPTH)
}

fn halve(f: &impl Fn(f64) -> f64, a: f64, b: f64, whole: f64, tolerance: f64, depth: u32) -> f64 {
    let middle = 0.5 * (a + b);
    let rule = gauss_legendre::<16>();
    // The difference is far above the error of the two halves, which are kept.
    let (left, right) = (rule.sum(a, middle, f), rule.sum(middle, b, f));
    let apart = (left + right - whole).abs();
    // A NaN cannot be improved by halving.
    if depth == 0 || apart <= tolerance || apart.is_nan() {
        return left + right;
    }
    halve(f, a, middle, left, tolerance, depth - 1) + halve(f, middle, b, right, tolerance, depth - 1)
}
