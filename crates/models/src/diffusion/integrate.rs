//! Adaptive quadrature over the age of a release.

use fewbits_numerics::quadrature::{Stop, by_halves, gauss_legendre};

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

/// `int_a^b f`, with an error of about `relative` times the integral of `|f|`.
fn integrate(f: &impl Fn(f64) -> f64, a: f64, b: f64, relative: f64) -> f64 {
    let rule = gauss_legendre::<16>();
    let whole = rule.composite(a, b, 4, f);
    let scale = rule.composite(a, b, 4, |x| f(x).abs());
    let stop = Stop {
        tolerance: relative * scale.max(f64::MIN_POSITIVE),
        halvings: MAX_DEPTH,
    };
    by_halves([a, b], whole, stop, &|a, b| rule.sum(a, b, f), &mut |_, _| {})
}
