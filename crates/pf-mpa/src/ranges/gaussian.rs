//! One filter of the bank: a Gaussian of position, velocity, common bias, error of scale, and biases of single anchors.
//!
//! ```text
//! state     positions (2 or 3), as many velocities, bias, scale, one bias per anchor, that of one anchor, or none
//! range     (1 + scale) |position - anchor| + bias + bias of the anchor + noise
//! moments   of the distance by cubature over the position, so that a wide belief near an anchor is not linearised at one point
//! ```

use super::measured::Measured;
use super::root::root;
use super::step::Step;

/// Calls a function with constant numbers of coordinates and positions, so that its loops are unrolled. Rare numbers of coordinates are `0`.
macro_rules! of_size {
    ($normal:ident.$function:ident($($argument:expr),*)) => {
        match ($normal.mean.len(), $normal.axes) {
            (6, 2) => $normal.$function::<6, 2>($($argument),*),
            (7, 2) => $normal.$function::<7, 2>($($argument),*),
            (8, 3) => $normal.$function::<8, 3>($($argument),*),
            (9, 3) => $normal.$function::<9, 3>($($argument),*),
            (10, 2) => $normal.$function::<10, 2>($($argument),*),
            (11, 2) => $normal.$function::<11, 2>($($argument),*),
            (12, 2) => $normal.$function::<12, 2>($($argument),*),
            (_, 2) => $normal.$function::<0, 2>($($argument),*),
            _ => $normal.$function::<0, 3>($($argument),*),
        }
    };
}

/// A normal law of the state. The covariance is stored in full, row by row.
#[derive(Debug, PartialEq)]
pub(super) struct Normal {
    pub(super) mean: Vec<f64>,
    pub(super) covariance: Vec<f64>,
    /// Number of positions, 2 or 3.
    pub(super) axes: usize,
    /// The one anchor that has a bias of its own, if it is one.
    pub(super) only: Option<usize>,
}

/// Moments of one noise-free range. Its covariance with the state stands in a buffer beside.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Predicted {
    pub(super) mean: f64,
    pub(super) variance: f64,
}

impl Clone for Normal {
    fn clone(&self) -> Self {
        Self {
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
            axes: self.axes,
            only: self.only,
        }
    }

    /// Copies into the buffers that are there.
    fn clone_from(&mut self, from: &Self) {
        (self.axes, self.only) = (from.axes, from.only);
        if self.mean.len() == from.mean.len() {
            of_size!(self.copy_of(from));
        } else {
            self.mean.clone_from(&from.mean);
            self.covariance.clone_from(&from.covariance);
        }
    }
}

impl Normal {
    /// What a filter of weight zero holds.
    pub(super) fn unknown() -> Self {
        Self {
            mean: Vec::new(),
            covariance: Vec::new(),
            axes: 0,
            only: None,
        }
    }

    fn copy_of<const N: usize, const AXES: usize>(&mut self, from: &Self) {
        let n = if N > 0 { N } else { self.mean.len() };
        self.mean[..n].copy_from_slice(&from.mean[..n]);
        self.covariance[..n * n].copy_from_slice(&from.covariance[..n * n]);
    }

    pub(super) fn bias(&self) -> usize {
        2 * self.axes
    }

    /// The coordinate of an anchor's own bias.
    pub(super) fn own(&self, anchor: usize) -> Option<usize> {
        let at = |number: usize| Some(2 * self.axes + 2 + number).filter(|at| *at < self.mean.len());
        match self.only {
            Some(only) => at(0).filter(|_| only == anchor),
            None => at(anchor),
        }
    }

    pub(super) fn variance(&self, i: usize) -> f64 {
        self.covariance[i * self.mean.len() + i]
    }

    /// Whether means and variances are finite, and no variance is negative.
    pub(super) fn is_finite(&self) -> bool {
        of_size!(self.is_finite_of())
    }

    fn is_finite_of<const N: usize, const AXES: usize>(&self) -> bool {
        let n = if N > 0 { N } else { self.mean.len() };
        let (means, covariance) = (&self.mean[..n], &self.covariance[..n * n]);
        // `0 x` is zero for finite numbers only, and a sum needs no branch per number.
        let (mut rest, mut least) = (0.0, 0.0_f64);
        for i in 0..n {
            let variance = covariance[i * n + i];
            rest += 0.0 * means[i] + 0.0 * variance;
            least = if variance < least { variance } else { least };
        }
        rest == 0.0 && least >= 0.0
    }

    /// Moves the state by a step whose velocities have this variance.
    pub(super) fn predict(&mut self, step: &Step, speed_variance: f64) {
        of_size!(self.predict_of(step, speed_variance));
    }

    fn predict_of<const N: usize, const AXES: usize>(&mut self, step: &Step, speed_variance: f64) {
        let n = if N > 0 { N } else { self.mean.len() };
        let (axes, bias) = (AXES, 2 * AXES);
        let (means, covariance) = (&mut self.mean[..n], &mut self.covariance[..n * n]);
        for p in 0..axes {
            means[p] += step.reach * means[axes + p];
            means[axes + p] *= step.kept;
        }
        let (positions, rest) = covariance.split_at_mut(axes * n);
        for (position, velocity) in positions.chunks_exact_mut(n).zip(rest.chunks_exact_mut(n)) {
            for (p, v) in position.iter_mut().zip(velocity) {
                *p += step.reach * *v;
                *v *= step.kept;
            }
        }
        for row in covariance.chunks_exact_mut(n) {
            let (positions, rest) = row.split_at_mut(axes);
            for (p, v) in positions.iter_mut().zip(rest) {
                *p += step.reach * *v;
                *v *= step.kept;
            }
        }
        let cross = step.cross * speed_variance;
        for p in 0..axes {
            let v = axes + p;
            covariance[p * n + p] += step.position * speed_variance;
            covariance[v * n + v] += step.velocity * speed_variance;
            covariance[p * n + v] += cross;
            covariance[v * n + p] += cross;
        }
        covariance[bias * n + bias] += step.drift;
    }

    /// Gives the velocities another deviation, before they have moved anything.
    pub(super) fn set_speed(&mut self, speed: f64) {
        let n = self.mean.len();
        (self.axes..2 * self.axes).for_each(|v| self.covariance[v * n + v] = speed * speed);
    }

    /// Makes the common bias independent of everything, with this mean and variance.
    pub(super) fn forget_bias(&mut self, mean: f64, variance: f64) {
        let (n, bias) = (self.mean.len(), self.bias());
        for i in 0..n {
            self.covariance[i * n + bias] = 0.0;
            self.covariance[bias * n + i] = 0.0;
        }
        self.mean[bias] = mean;
        self.covariance[bias * n + bias] = variance;
    }

    /// Moments of the noise-free range to an anchor. `place`: its coordinates. `above`: what it is higher than the target if heights are known.
    /// `cross` gets its covariance with the state, a number for each coordinate.
    pub(super) fn range(
        &self,
        measured: Measured,
        place: &[f64; 3],
        above: f64,
        anchor: usize,
        cross: &mut [f64],
    ) -> Predicted {
        of_size!(self.range_of(measured, place, above, anchor, cross))
    }

    fn range_of<const N: usize, const AXES: usize>(
        &self,
        measured: Measured,
        place: &[f64; 3],
        above: f64,
        anchor: usize,
        cross: &mut [f64],
    ) -> Predicted {
        let n = if N > 0 { N } else { self.mean.len() };
        let (axes, bias, scale) = (AXES, 2 * AXES, 2 * AXES + 1);
        let (means, covariance) = (&self.mean[..n], &self.covariance[..n * n]);
        // A known height: the third coordinates differ by `above`.
        let mut at = [means[0], means[1], place[2] - above];
        if axes == 3 {
            at[2] = means[2];
        }
        let distance = |point: &[f64; 3]| {
            let off = [point[0] - place[0], point[1] - place[1], point[2] - place[2]];
            (off[0] * off[0] + off[1] * off[1] + off[2] * off[2]).sqrt()
        };
        let far = distance(&at);
        let centre = measured.of(far);
        let spread: f64 = (0..axes).map(|i| covariance[i * n + i]).sum();
        // Gradient of the distance by the position, its mean, and the variance that the gradient does not explain.
        let (mut gradient, mut mean, mut rest) = ([0.0; AXES], centre, 0.0);
        let root = if spread > 1e-5 * far * far {
            root::<AXES>(axes, 1e-14 * spread, |i, j| covariance[i * n + j])
        } else {
            None
        };
        if let Some(root) = root {
            let reach = (axes as f64).sqrt();
            let (mut sum, mut squares, mut slopes) = (0.0, 0.0, [0.0; AXES]);
            for (column, slope) in slopes.iter_mut().enumerate() {
                let ends = [1.0, -1.0].map(|sign| {
                    let mut point = at;
                    (0..axes).for_each(|i| point[i] += sign * reach * root[i][column]);
                    measured.of(distance(&point)) - centre
                });
                sum += ends[0] + ends[1];
                squares += ends[0] * ends[0] + ends[1] * ends[1];
                *slope = (ends[0] - ends[1]) / (2.0 * reach);
            }
            let count = 2.0 * axes as f64;
            let shift = sum / count;
            mean += shift;
            let explained: f64 = slopes.iter().map(|s| s * s).sum();
            rest = (squares / count - shift * shift - explained).max(0.0);
            // Solves `root' gradient = slopes`; `root` is lower triangular.
            for i in (0..axes).rev() {
                let later: f64 = (i + 1..axes).map(|j| root[j][i] * gradient[j]).sum();
                gradient[i] = (slopes[i] - later) / root[i][i];
            }
        } else if far > 0.0 {
            let slope = measured.slope(far);
            (0..axes).for_each(|i| gradient[i] = slope * ((at[i] - place[i]) / far));
        }
        let factor = 1.0 + means[scale];
        let own = self.own(anchor);
        let expected = factor * mean + means[bias] + own.map_or(0.0, |own| means[own]);
        // The covariance is symmetric: a sum of rows, by what each coordinate does to the range.
        let cross = &mut cross[..n];
        let row = |i: usize| &covariance[i * n..(i + 1) * n];
        let (first, second) = (factor * gradient[0], factor * gradient[1]);
        let (x, y, biases, scales) = (row(0), row(1), row(bias), row(scale));
        for (i, sum) in cross.iter_mut().enumerate() {
            *sum = first * x[i] + second * y[i] + (biases[i] + mean * scales[i]);
        }
        let more = [
            (axes == 3).then(|| (2, factor * gradient[axes - 1])),
            own.map(|own| (own, 1.0)),
        ];
        for (i, slope) in more.into_iter().flatten() {
            cross.iter_mut().zip(row(i)).for_each(|(sum, x)| *sum += slope * x);
        }
        let positions: f64 = (0..axes).map(|i| cross[i] * gradient[i]).sum();
        let linear = factor * positions + mean * cross[scale] + cross[bias] + own.map_or(0.0, |own| cross[own]);
        // Variance of the position along the gradient.
        let along = |i: usize| -> f64 { (0..axes).map(|j| covariance[i * n + j] * gradient[j]).sum() };
        let explained = (0..axes).map(|i| along(i) * gradient[i]).sum::<f64>().max(0.0);
        Predicted {
            mean: expected,
            variance: linear.max(0.0) + factor * factor * rest + scales[scale] * (rest + explained),
        }
    }

    /// Conditions on a range whose noise-free value has this mean and variance afterwards. `holds_scale`: mean and variance of the error of
    /// scale stay as they are, and what it does to the other coordinates is kept in its covariances with them (a filter with a considered
    /// parameter, Schmidt 1966). So a direction in which the ranges say nothing is not taken for known because the range is linearised at
    /// another place each time.
    pub(super) fn condition(
        &mut self,
        (predicted, cross): (Predicted, &[f64]),
        (mean, variance): (f64, f64),
        holds_scale: bool,
    ) {
        if predicted.variance > 0.0 {
            of_size!(self.condition_of((predicted, cross), mean, variance, holds_scale));
        }
    }

    fn condition_of<const N: usize, const AXES: usize>(
        &mut self,
        (predicted, cross): (Predicted, &[f64]),
        mean: f64,
        variance: f64,
        holds_scale: bool,
    ) {
        let n = if N > 0 { N } else { self.mean.len() };
        let scale = 2 * AXES + 1;
        let (means, covariance, cross) = (&mut self.mean[..n], &mut self.covariance[..n * n], &cross[..n]);
        let shift = (mean - predicted.mean) / predicted.variance;
        let shrink = (predicted.variance - variance) / (predicted.variance * predicted.variance);
        let held = (means[scale], covariance[scale * n + scale]);
        for (mean, cross) in means.iter_mut().zip(cross) {
            *mean += cross * shift;
        }
        for (row, of_row) in covariance.chunks_exact_mut(n).zip(cross) {
            let gain = of_row * shrink;
            for (x, other) in row.iter_mut().zip(cross) {
                *x -= gain * other;
            }
        }
        if holds_scale {
            if shrink < 0.0 {
                // A variance that grows, as that of a doubtful range does: what is held has no part in it, or its covariances would outgrow its
                // variance.
                let back = cross[scale] * shrink;
                for (i, cross) in cross.iter().enumerate() {
                    covariance[scale * n + i] += back * cross;
                    covariance[i * n + scale] = covariance[scale * n + i];
                }
            }
            (means[scale], covariance[scale * n + scale]) = held;
        }
        // Rounding must not leave a negative variance of a coordinate that is known.
        covariance
            .iter_mut()
            .step_by(n + 1)
            .for_each(|variance| *variance = variance.max(0.0));
    }
}

impl Normal {
    /// Adds to the covariance what a part of a mixture with this mean has in it.
    fn add_part<const N: usize, const AXES: usize>(&mut self, share: f64, part: &Self) {
        let n = if N > 0 { N } else { self.mean.len() };
        let (means, centre) = (&part.mean[..n], &self.mean[..n]);
        let (sums, rows) = (&mut self.covariance[..n * n], &part.covariance[..n * n]);
        for (i, (sums, row)) in sums.chunks_exact_mut(n).zip(rows.chunks_exact(n)).enumerate() {
            let between = share * (means[i] - centre[i]);
            for j in 0..n {
                sums[j] += share * row[j] + between * (means[j] - centre[j]);
            }
        }
    }
}

/// The normal law with the moments of a mixture. Weights need not sum to one. Returns whether there is such a law: not if they sum to zero.
pub(super) fn merge_into<'a>(parts: impl Iterator<Item = (f64, &'a Normal)> + Clone, out: &mut Normal) -> bool {
    let total: f64 = parts.clone().map(|(weight, _)| weight).sum();
    let Some((_, first)) = parts.clone().next().filter(|_| total > 0.0 && total.is_finite()) else {
        return false;
    };
    let n = first.mean.len();
    (out.axes, out.only) = (first.axes, first.only);
    out.mean.clear();
    out.mean.resize(n, 0.0);
    out.covariance.clear();
    out.covariance.resize(n * n, 0.0);
    for (weight, part) in parts.clone() {
        let share = weight / total;
        out.mean
            .iter_mut()
            .zip(&part.mean)
            .for_each(|(sum, x)| *sum += share * x);
    }
    for (weight, part) in parts {
        of_size!(out.add_part(weight / total, part));
    }
    true
}

#[cfg(test)]
mod tests;
