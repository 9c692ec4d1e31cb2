//! Quadrature over the angle `theta` of the leading component, `q_1 = radius sin(theta)`.

use fewbits_numerics::quadrature::{Stop, by_halves, gauss_legendre};
use fewbits_numerics::{bisect, golden};
use std::f64::consts::FRAC_PI_2;

/// Largest mean, in standard deviations, for a fixed rule of 24 nodes; `FAR` for 40 nodes. Beyond `FAR` the quadrature is adaptive.
pub(super) const NEAR: f64 = 4.0;
const FAR: f64 = 8.0;
/// Largest radius, in standard deviations, for a fixed rule.
const RADIUS: f64 = 5.0;
/// The integrand is cut where its logarithm has fallen by this much from its peak.
const FALL: f64 = 40.0;
/// A panel is halved until its two rules agree to this share of the whole integral ...
const TOLERANCE: f64 = 1e-10;
/// ... or to this much per unit of the integrand's logarithm (rounding in far tails), at most `HALVINGS` times.
const ROUNDING: f64 = 4e-15;
const HALVINGS: u32 = 40;
/// Limit on the halvings where the integrand has steps: a step is located to `pi / 2^24`.
const STEP_HALVINGS: u32 = 24;
/// Distances from a component's mean at which the range is cut, in standard deviations. Beyond the last the density has fallen by
/// `exp(-32)`.
const CUTS: [f64; 3] = [0.0, 2.0, 8.0];

/// Nodes and weights of the 24-point Gauss-Legendre rule on `[a, b]`.
pub(super) fn panel(a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> {
    gauss_legendre::<24>().on(a, b)
}

/// Whether all means are within `reach` standard deviations of zero and the radius within `RADIUS`.
pub(super) fn tame(variances: &[f64], means: &[f64], eta: f64, reach: f64) -> bool {
    let tame = |(w, b): (&f64, &f64)| b * b <= reach * reach * w && eta <= RADIUS * RADIUS * w;
    variances.iter().zip(means).all(tame)
}

/// Visits nodes and weights of a quadrature over `theta` in `[-pi/2, pi/2]` that integrates `exp(f)`, a function with one mode,
/// for independent components `q_j ~ N(b_j, w_j)` in a ball of squared radius `eta`.
pub(super) fn with_one_mode(
    variances: &[f64],
    means: &[f64],
    eta: f64,
    f: impl Fn(f64) -> f64,
    mut visit: impl FnMut(f64, f64),
) {
    let node = |(theta, w): (f64, f64)| visit(theta, w);
    // Fixed rules where the integrand is smooth; elsewhere panels about the mode.
    if tame(variances, means, eta, NEAR) {
        return panel(-FRAC_PI_2, FRAC_PI_2).for_each(node);
    }
    if tame(variances, means, eta, FAR) {
        return gauss_legendre::<40>().on(-FRAC_PI_2, FRAC_PI_2).for_each(node);
    }
    let (mode, peak) = golden::maximum(&f, -FRAC_PI_2, FRAC_PI_2, 1e-12);
    // Bisection for the angle at which the integrand has fallen by exp(-FALL).
    let end = |outer: f64| bisect::boundary(|theta| f(theta) > peak - FALL, mode, outer, 30).1;
    let bulk = [end(-FRAC_PI_2), mode, end(FRAC_PI_2)];
    adaptive(&bulk, peak, TOLERANCE.max(ROUNDING * peak.abs()), HALVINGS, &f, &mut visit);
}

/// As [`with_one_mode`] for any function. It is smooth between the `cuts`, which increase.
pub(super) fn over_angles(cuts: &[f64], f: impl Fn(f64) -> f64, mut visit: impl FnMut(f64, f64)) {
    let nodes = cuts.windows(2).flat_map(|pair| panel(pair[0], pair[1]));
    let peak = nodes.map(|(theta, _)| f(theta)).fold(f64::NEG_INFINITY, f64::max);
    if peak > f64::NEG_INFINITY {
        adaptive(cuts, peak, TOLERANCE, STEP_HALVINGS, &f, &mut visit);
    }
}

/// Visits nodes and weights of a quadrature of `exp(f)` between the cuts, from left to right. A panel is halved until its rule and the
/// rules of its halves agree to the share `tolerance` of the whole. `peak` is approximately the largest `f`.
fn adaptive(
    cuts: &[f64],
    peak: f64,
    tolerance: f64,
    halvings: u32,
    f: &impl Fn(f64) -> f64,
    visit: &mut impl FnMut(f64, f64),
) {
    let mass = |a: f64, b: f64| panel(a, b).map(|(theta, w)| w * (f(theta) - peak).exp()).sum::<f64>();
    let panels: Vec<_> = cuts
        .windows(2)
        .map(|pair| ([pair[0], pair[1]], mass(pair[0], pair[1])))
        .collect();
    let whole: f64 = panels.iter().rev().map(|panel| panel.1).sum();
    if !whole.is_finite() {
        return;
    }
    let stop = Stop {
        tolerance: tolerance * whole,
        halvings,
    };
    for (ends, coarse) in panels {
        by_halves(ends, coarse, stop, &mass, &mut |a, b| {
            panel(a, b).for_each(|(theta, w)| visit(theta, w));
        });
    }
}

/// Increasing angles at which the integrand may change quickly: the ends of the leading component's bulk, and the angles at which the
/// ball's surface passes through the bulk of another component.
pub(super) fn cuts(variances: &[f64], means: &[f64], radius: f64) -> Vec<f64> {
    let mut all = vec![-FRAC_PI_2, 0.0, FRAC_PI_2];
    for (i, (w, b)) in variances.iter().zip(means).enumerate() {
        for at in CUTS
            .into_iter()
            .flat_map(|cut| [b - cut * w.sqrt(), b + cut * w.sqrt()])
        {
            let ratio = at / radius;
            if ratio.abs() < 1.0 {
                match i {
                    0 => all.push(ratio.asin()),
                    _ => all.extend([ratio.abs().acos(), -ratio.abs().acos()]),
                }
            }
        }
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}
