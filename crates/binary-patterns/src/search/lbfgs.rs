//! Limited-memory BFGS, for smooth unconstrained problems of a few dozen variables.

use std::collections::VecDeque;

/// Number of steps from which the Hessian is estimated.
const MEMORY: usize = 12;
/// Constants of the Wolfe conditions: sufficient decrease, and curvature.
const DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Bisections of a step; 40 leave `1e-12` of it.
const LINE_STEPS: usize = 40;
/// Consecutive iterations with too small a decrease that end the search: one alone may be due to a poor direction.
const MAX_STALLED: usize = 3;

/// Minimises `f`, which returns the value and writes the gradient. Returns the last point, whose value is never above that at the
/// start. The search ends after `iterations`, or if the value no longer decreases by the share `decrease`.
///
/// Two-loop recursion with a bisecting weak-Wolfe line search, which keeps the curvature `s.y` positive.
pub(crate) fn minimise(
    mut f: impl FnMut(&[f64], &mut [f64]) -> f64,
    start: Vec<f64>,
    iterations: usize,
    decrease: f64,
) -> Vec<f64> {
    let mut x = start;
    let mut gradient = vec![0.0; x.len()];
    let mut value = f(&x, &mut gradient);
    let mut pairs: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::new();
    let mut stalled = 0;
    for _ in 0..iterations {
        let direction = descent_direction(&gradient, &pairs);
        let slope = dot(&gradient, &direction);
        if slope >= 0.0 || slope.is_nan() {
            break;
        }
        // The curvature is not known at first: take a step of moderate length.
        let first = if pairs.is_empty() {
            0.1 / dot(&direction, &direction).sqrt()
        } else {
            1.0
        };
        let Some((trial, trial_gradient, at)) = line_search(&mut f, &x, value, &direction, slope, first) else {
            break;
        };
        let s: Vec<f64> = trial.iter().zip(&x).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = trial_gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        let curvature = dot(&s, &y);
        // A pair whose curvature is only rounding would make the estimated Hessian indefinite.
        if curvature > 1e-14 * dot(&s, &s).sqrt() * dot(&y, &y).sqrt() {
            pairs.push_back((s, y, 1.0 / curvature));
            if pairs.len() > MEMORY {
                pairs.pop_front();
            }
        }
        let is_stalled = value - at <= decrease * value.abs();
        stalled = if is_stalled { stalled + 1 } else { 0 };
        (x, value, gradient) = (trial, at, trial_gradient);
        if stalled >= MAX_STALLED {
            break;
        }
    }
    x
}

/// A point along `direction` with sufficient decrease and, if possible, a flatter slope: returns point, gradient, value.
fn line_search(
    f: &mut impl FnMut(&[f64], &mut [f64]) -> f64,
    x: &[f64],
    value: f64,
    direction: &[f64],
    slope: f64,
    first: f64,
) -> Option<(Vec<f64>, Vec<f64>, f64)> {
    let (mut low, mut high, mut step) = (0.0, f64::INFINITY, first);
    let mut best: Option<(Vec<f64>, Vec<f64>, f64)> = None;
    for _ in 0..LINE_STEPS {
        let trial: Vec<f64> = x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
        let mut gradient = vec![0.0; x.len()];
        let at = f(&trial, &mut gradient);
        // A value of NaN means that the step was too long.
        if at <= value + DECREASE * step * slope {
            let flat = dot(&gradient, direction) >= CURVATURE * slope;
            best = Some((trial, gradient, at));
            if flat {
                break;
            }
            low = step;
        } else {
            high = step;
        }
        // Too long: bisect. Long enough, but the slope is still steep: longer, until a step is too long.
        step = if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * step
        };
    }
    best
}

/// Minus the gradient times the inverse Hessian that the pairs `(s, y, 1 / s.y)` of the last steps imply.
fn descent_direction(gradient: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>, f64)>) -> Vec<f64> {
    let mut q: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut shares = Vec::with_capacity(pairs.len());
    for (s, y, inverse) in pairs.iter().rev() {
        let share = inverse * dot(s, &q);
        q.iter_mut().zip(y).for_each(|(q, y)| *q -= share * y);
        shares.push(share);
    }
    // The first estimate of the inverse Hessian is the identity, in the scale of the last step.
    if let Some((s, y, _)) = pairs.back() {
        let scale = dot(s, y) / dot(y, y);
        q.iter_mut().for_each(|q| *q *= scale);
    }
    for ((s, y, inverse), share) in pairs.iter().zip(shares.into_iter().rev()) {
        let back = share - inverse * dot(y, &q);
        q.iter_mut().zip(s).for_each(|(q, s)| *q += back * s);
    }
    q
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_banana_valley_is_followed_to_its_end() {
        let rosenbrock = |x: &[f64], g: &mut [f64]| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            g[0] = -2.0 * a - 400.0 * x[0] * b;
            g[1] = 200.0 * b;
            a * a + 100.0 * b * b
        };
        let x = minimise(rosenbrock, vec![-1.2, 1.0], 200, 1e-30);
        let value = rosenbrock(&x, &mut [0.0; 2]);
        assert!(value < 1e-18 && (x[0] - 1.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8, "{x:?} {value}");
    }
}
