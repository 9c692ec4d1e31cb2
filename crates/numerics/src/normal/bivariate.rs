//! Rectangle probabilities of two correlated normal variables.

use super::{interval, pdf};
use crate::error::{self, ArgumentError};
use crate::quadrature::gauss_legendre;

/// Beyond this the density underflows.
const REACH: f64 = 38.0;
/// Panels whose middle is this much below the largest one carry nothing.
const NEGLIGIBLE: f64 = 1e-22;

/// `P(lower[0] < X < upper[0], lower[1] < Y < upper[1])` for standard normal `X`, `Y` with correlation `rho`.
///
/// Integrates `phi(x) [Phi((u - rho x)/s) - Phi((l - rho x)/s)]`, `s = sqrt(1 - rho^2)`, with Gauss-Legendre panels that are
/// fine around the two steps of the bracket. All terms are positive, so far rectangles keep their relative accuracy
/// (about 1e-13). `|rho| = 1` is the interval that remains on the diagonal.
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
    if rho.abs() == 1.0 {
        let (l, u) = if rho > 0.0 {
            (lower[1], upper[1])
        } else {
            (-upper[1], -lower[1])
        };
        return Ok(interval(lower[0].max(l), upper[0].min(u)));
    }
    let s = ((1.0 - rho) * (1.0 + rho)).sqrt();
    let (from, to) = (lower[0].max(-REACH), upper[0].min(REACH));
    if from >= to || lower[1] >= upper[1] {
        return Ok(0.0);
    }
    let bracket = |x: f64| interval((lower[1] - rho * x) / s, (upper[1] - rho * x) / s);
    let mut edges = panel_edges(from, to);
    if rho != 0.0 {
        for step in [lower[1] / rho, upper[1] / rho] {
            refine(&mut edges, from, to, step, s / rho.abs());
        }
    }
    edges.sort_by(f64::total_cmp);
    let middles: Vec<f64> = edges
        .windows(2)
        .map(|e| {
            let middle = 0.5 * (e[0] + e[1]);
            (e[1] - e[0]) * pdf(middle) * bracket(middle)
        })
        .collect();
    let largest = middles.iter().copied().fold(0.0, f64::max);
    let rule = gauss_legendre::<20>();
    Ok(edges
        .windows(2)
        .zip(&middles)
        .filter(|(e, middle)| e[0] < e[1] && **middle >= NEGLIGIBLE * largest)
        .map(|(e, _)| rule.sum(e[0], e[1], |x| pdf(x) * bracket(x)))
        .sum())
}

fn panel_edges(from: f64, to: f64) -> Vec<f64> {
    let panels = ((to - from).ceil() as usize).max(1);
    (0..=panels)
        .map(|i| from + (to - from) * i as f64 / panels as f64)
        .collect()
}

/// Adds edges around a step of the bracket at `centre` whose width is `scale`.
fn refine(edges: &mut Vec<f64>, from: f64, to: f64, centre: f64, scale: f64) {
    if !centre.is_finite() {
        return;
    }
    for i in -10..=10 {
        let edge = centre + f64::from(i) * scale;
        if from < edge && edge < to {
            edges.push(edge);
        }
    }
}
