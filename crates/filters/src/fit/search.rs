//! A maximum by quasi-Newton steps, and the information there.

use nalgebra::{DMatrix, DVector};

/// Steps at most, halvings of a step at most, and step of the differences.
const STEPS: usize = 80;
const HALVINGS: usize = 14;
const DIFFERENCE: f64 = 1e-4;
/// A step that raises the function by less ends the search.
const LITTLE: f64 = 1e-6;
/// Longest step in a coordinate.
const MAX_STEP: f64 = 1.5;

fn gradient(of: &impl Fn(&DVector<f64>) -> f64, at: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(at.len(), |i, _| {
        let moved = |by: f64| {
            let mut other = at.clone();
            other[i] += by;
            of(&other)
        };
        let slope = (moved(DIFFERENCE) - moved(-DIFFERENCE)) / (2.0 * DIFFERENCE);
        if slope.is_finite() { slope } else { 0.0 }
    })
}

/// A local maximum near a start (Broyden, Fletcher, Goldfarb and Shanno's steps, backtracking).
pub(super) fn maximum(of: impl Fn(&DVector<f64>) -> f64, start: DVector<f64>) -> (DVector<f64>, f64) {
    let count = start.len();
    let (mut x, mut best) = (start.clone(), of(&start));
    if count == 0 {
        return (x, best);
    }
    let mut inverse = DMatrix::<f64>::identity(count, count);
    let mut slope = gradient(&of, &x);
    let mut is_fresh = true;
    for _ in 0..STEPS {
        let mut step = &inverse * &slope;
        if step.dot(&slope) <= 0.0 {
            inverse.fill_with_identity();
            step = slope.clone();
        }
        let longest = step.amax();
        if longest > MAX_STEP {
            step *= MAX_STEP / longest;
        }
        let (mut share, mut next) = (1.0, None);
        for _ in 0..HALVINGS {
            let other = &x + &step * share;
            let found = of(&other);
            if found > best {
                next = Some((other, found));
                break;
            }
            share *= 0.5;
        }
        let Some((other, found)) = next else {
            if is_fresh {
                break;
            }
            // The curvature may be wrong: once more along the slope.
            inverse.fill_with_identity();
            is_fresh = true;
            continue;
        };
        let rise = found - best;
        let other_slope = gradient(&of, &other);
        let (moved, bent) = (&other - &x, &slope - &other_slope);
        let curvature = moved.dot(&bent);
        if curvature > 1e-12 * moved.norm() * bent.norm() {
            if is_fresh {
                inverse *= curvature / bent.norm_squared();
            }
            let image = &inverse * &bent;
            let factor = (1.0 + bent.dot(&image) / curvature) / curvature;
            inverse += &moved * moved.transpose() * factor
                - (&image * moved.transpose() + &moved * image.transpose()) / curvature;
            is_fresh = false;
        }
        (x, best, slope) = (other, found, other_slope);
        if rise < LITTLE {
            break;
        }
    }
    (x, best)
}

/// The observed information: minus the second derivatives, by differences of these steps.
pub(super) fn information(of: impl Fn(&DVector<f64>) -> f64, at: &DVector<f64>, steps: &[f64]) -> DMatrix<f64> {
    let count = at.len();
    let value = |moves: &[(usize, f64)]| {
        let mut other = at.clone();
        moves.iter().for_each(|(i, by)| other[*i] += by);
        of(&other)
    };
    let middle = of(at);
    let mut found = DMatrix::zeros(count, count);
    for i in 0..count {
        let own = steps[i];
        found[(i, i)] = (2.0 * middle - value(&[(i, own)]) - value(&[(i, -own)])) / (own * own);
        for j in 0..i {
            let other = steps[j];
            let mixed =
                value(&[(i, own), (j, other)]) - value(&[(i, own), (j, -other)]) - value(&[(i, -own), (j, other)])
                    + value(&[(i, -own), (j, -other)]);
            found[(i, j)] = -mixed / (4.0 * own * other);
            found[(j, i)] = found[(i, j)];
        }
    }
    found
}
