//! A maximum by quasi-Newton steps, and the information there.

use nalgebra::{DMatrix, DVector};

/// Steps at most, halvings of a step at most, and step of the differences.
const STEPS: usize = 80;
const HALVINGS: usize = 14;
const DIFFERENCE: f64 = 1e-4;
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

/// Where a search ended.
pub(super) struct Maximum {
    pub(super) point: DVector<f64>,
    pub(super) value: f64,
    /// The inverse of minus the second derivatives, as far as the steps found it out.
    pub(super) inverse: Option<DMatrix<f64>>,
}

/// A local maximum near zero (Broyden, Fletcher, Goldfarb and Shanno's steps, backtracking). `known`: an inverse of minus the second derivatives
/// to begin with. `little`: a step that raises the function by less ends the search.
pub(super) fn maximum(
    of: impl Fn(&DVector<f64>) -> f64,
    count: usize,
    known: Option<DMatrix<f64>>,
    little: f64,
) -> Maximum {
    let start = DVector::zeros(count);
    let (mut x, mut best) = (start.clone(), of(&start));
    let mut inverse = DMatrix::<f64>::identity(count, count);
    let mut is_fresh = true;
    if let Some(known) = known.filter(|known| known.shape() == (count, count)) {
        (inverse, is_fresh) = (known, false);
    }
    if count == 0 {
        return Maximum {
            point: x,
            value: best,
            inverse: None,
        };
    }
    let mut slope = gradient(&of, &x);
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
        if rise < little {
            break;
        }
    }
    Maximum {
        point: x,
        value: best,
        inverse: (!is_fresh).then_some(inverse),
    }
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
    let single: Vec<f64> = (0..count)
        .map(|i| value(&[(i, steps[i])]) + value(&[(i, -steps[i])]) - 2.0 * middle)
        .collect();
    let mut found = DMatrix::zeros(count, count);
    for i in 0..count {
        found[(i, i)] = -single[i] / (steps[i] * steps[i]);
        for j in 0..i {
            let both = value(&[(i, steps[i]), (j, steps[j])]) + value(&[(i, -steps[i]), (j, -steps[j])]) - 2.0 * middle;
            found[(i, j)] = -0.5 * (both - single[i] - single[j]) / (steps[i] * steps[j]);
            found[(j, i)] = found[(i, j)];
        }
    }
    found
}
