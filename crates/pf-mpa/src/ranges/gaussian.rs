//! One filter of the bank: a Gaussian of position, velocity, common bias, error of scale, and biases of single anchors.
//!
//! ```text
//! state     positions (2 or 3), as many velocities, bias, scale, one bias per anchor or none
//! range     (1 + scale) |position - anchor| + bias + bias of the anchor + noise
//! moments   of the distance by cubature over the position, so that a wide belief near an anchor is not linearised at one point
//! ```

/// A normal law of the state. The covariance is stored in full, row by row.
#[derive(Debug, PartialEq)]
pub(super) struct Normal {
    pub(super) mean: Vec<f64>,
    pub(super) covariance: Vec<f64>,
    /// Number of positions, 2 or 3.
    pub(super) axes: usize,
}

/// Moments of one noise-free range: mean, variance, and covariance with the state.
#[derive(Debug, Clone, Default)]
pub(super) struct Predicted {
    pub(super) mean: f64,
    pub(super) variance: f64,
    pub(super) cross: Vec<f64>,
}

/// What a stretch of time does to positions and velocities of one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// The velocity's share that stays, and the seconds that it lasts.
    kept: f64,
    reach: f64,
    /// Added (co)variances for a velocity of unit deviation.
    position: f64,
    cross: f64,
    velocity: f64,
    /// Added variance of the common bias.
    drift: f64,
}

impl Step {
    /// Velocities that are forgotten within `persistence` (Ornstein-Uhlenbeck), over `seconds`.
    pub(super) fn over(seconds: f64, persistence: f64, drift: f64) -> Self {
        let (u, kept) = (seconds / persistence, (-seconds / persistence).exp());
        // `2u - 3 + 4k - k^2` cancels for short steps; its series begins with `2 u^3 / 3`.
        let position = if u < 1e-3 {
            u * u * u * (2.0 / 3.0 - 0.5 * u)
        } else {
            2.0 * u - 3.0 + 4.0 * kept - kept * kept
        };
        let lost = -(-u).exp_m1();
        Self {
            kept,
            reach: persistence * lost,
            position: persistence * persistence * position,
            cross: persistence * lost * lost,
            velocity: -(-2.0 * u).exp_m1(),
            drift: drift * seconds,
        }
    }
}

impl Clone for Normal {
    fn clone(&self) -> Self {
        Self {
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
            axes: self.axes,
        }
    }

    /// Copies into the buffers that are there.
    fn clone_from(&mut self, from: &Self) {
        self.mean.clone_from(&from.mean);
        self.covariance.clone_from(&from.covariance);
        self.axes = from.axes;
    }
}

impl Normal {
    pub(super) fn bias(&self) -> usize {
        2 * self.axes
    }

    pub(super) fn scale(&self) -> usize {
        2 * self.axes + 1
    }

    /// The coordinate of an anchor's own bias.
    pub(super) fn own(&self, anchor: usize) -> Option<usize> {
        let at = 2 * self.axes + 2 + anchor;
        (at < self.mean.len()).then_some(at)
    }

    pub(super) fn variance(&self, i: usize) -> f64 {
        self.covariance[i * self.mean.len() + i]
    }

    pub(super) fn is_finite(&self) -> bool {
        let n = self.mean.len();
        self.mean.iter().chain(&self.covariance).all(|x| x.is_finite())
            && (0..n).all(|i| self.covariance[i * n + i] >= 0.0)
    }

    /// Moves the state by a step whose velocities have this variance.
    pub(super) fn predict(&mut self, step: &Step, speed_variance: f64) {
        let n = self.mean.len();
        for axis in 0..self.axes {
            let (p, v) = (axis, self.axes + axis);
            self.mean[p] += step.reach * self.mean[v];
            self.mean[v] *= step.kept;
            for j in 0..n {
                self.covariance[p * n + j] += step.reach * self.covariance[v * n + j];
                self.covariance[v * n + j] *= step.kept;
            }
            for i in 0..n {
                self.covariance[i * n + p] += step.reach * self.covariance[i * n + v];
                self.covariance[i * n + v] *= step.kept;
            }
            self.covariance[p * n + p] += step.position * speed_variance;
            self.covariance[v * n + v] += step.velocity * speed_variance;
            self.covariance[p * n + v] += step.cross * speed_variance;
            self.covariance[v * n + p] += step.cross * speed_variance;
        }
        let bias = self.bias();
        self.covariance[bias * n + bias] += step.drift;
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
    pub(super) fn range(&self, place: &[f64; 3], above: f64, anchor: usize, out: &mut Predicted) {
        let (n, axes) = (self.mean.len(), self.axes);
        let (bias, scale) = (self.bias(), self.scale());
        let distance = |point: &[f64; 3]| {
            let squares: f64 = (0..axes).map(|i| (point[i] - place[i]).powi(2)).sum();
            (squares + above * above).sqrt()
        };
        let mut at = [0.0; 3];
        at[..axes].copy_from_slice(&self.mean[..axes]);
        let centre = distance(&at);
        let spread: f64 = (0..axes).map(|i| self.variance(i)).sum();
        // Gradient of the distance by the position, its mean, and the variance that the gradient does not explain.
        let (mut gradient, mut mean, mut rest) = ([0.0; 3], centre, 0.0);
        let root = if spread > 1e-5 * centre * centre {
            self.root(spread)
        } else {
            None
        };
        if let Some(root) = root {
            let reach = (axes as f64).sqrt();
            let (mut sum, mut squares, mut slopes) = (0.0, 0.0, [0.0; 3]);
            for (column, slope) in slopes.iter_mut().enumerate().take(axes) {
                let ends = [1.0, -1.0].map(|sign| {
                    let mut point = at;
                    (0..axes).for_each(|i| point[i] += sign * reach * root[i][column]);
                    distance(&point) - centre
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
        } else if centre > 0.0 {
            (0..axes).for_each(|i| gradient[i] = (at[i] - place[i]) / centre);
        }
        let factor = 1.0 + self.mean[scale];
        out.mean = factor * mean + self.mean[bias];
        let own = self.own(anchor);
        out.mean += own.map_or(0.0, |own| self.mean[own]);
        out.cross.clear();
        for i in 0..n {
            let row = &self.covariance[i * n..(i + 1) * n];
            let position: f64 = (0..axes).map(|j| row[j] * gradient[j]).sum();
            out.cross
                .push(factor * position + mean * row[scale] + row[bias] + own.map_or(0.0, |own| row[own]));
        }
        let positions: f64 = (0..axes).map(|i| out.cross[i] * gradient[i]).sum();
        let linear =
            factor * positions + mean * out.cross[scale] + out.cross[bias] + own.map_or(0.0, |own| out.cross[own]);
        out.variance = linear.max(0.0) + factor * factor * rest + self.variance(scale) * (rest + self.along(&gradient));
    }

    /// Variance of the position along a direction.
    fn along(&self, direction: &[f64; 3]) -> f64 {
        let n = self.mean.len();
        let row = |i: usize| -> f64 { (0..self.axes).map(|j| self.covariance[i * n + j] * direction[j]).sum() };
        (0..self.axes).map(|i| row(i) * direction[i]).sum::<f64>().max(0.0)
    }

    /// The lower triangular root of the positions' covariance; `None` if it is singular.
    fn root(&self, spread: f64) -> Option<[[f64; 3]; 3]> {
        let (n, mut root) = (self.mean.len(), [[0.0; 3]; 3]);
        for j in 0..self.axes {
            let left = self.covariance[j * n + j] - root[j][..j].iter().map(|x| x * x).sum::<f64>();
            if left <= 1e-14 * spread {
                return None;
            }
            root[j][j] = left.sqrt();
            for i in j + 1..self.axes {
                let known: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
                root[i][j] = (self.covariance[i * n + j] - known) / root[j][j];
            }
        }
        Some(root)
    }

    /// Conditions on a range whose noise-free value has this mean and variance afterwards. `holds_scale`: mean and variance of the error of
    /// scale stay as they are, and what it does to the other coordinates is kept in its covariances with them (a filter with a considered
    /// parameter, Schmidt 1966). So a direction in which the ranges say nothing is not taken for known because the range is linearised at
    /// another place each time.
    pub(super) fn condition(&mut self, predicted: &Predicted, mean: f64, variance: f64, holds_scale: bool) {
        if predicted.variance <= 0.0 {
            return;
        }
        let (n, scale) = (self.mean.len(), self.scale());
        let held = (self.mean[scale], self.variance(scale));
        let shift = (mean - predicted.mean) / predicted.variance;
        let shrink = (predicted.variance - variance) / (predicted.variance * predicted.variance);
        for i in 0..n {
            self.mean[i] += predicted.cross[i] * shift;
            let row = predicted.cross[i] * shrink;
            for j in 0..n {
                self.covariance[i * n + j] -= row * predicted.cross[j];
            }
        }
        if holds_scale {
            (self.mean[scale], self.covariance[scale * n + scale]) = held;
        }
        // Rounding must not leave a negative variance of a coordinate that is known.
        (0..n).for_each(|i| self.covariance[i * n + i] = self.covariance[i * n + i].max(0.0));
    }
}

/// The normal law with the moments of a mixture. Weights need not sum to one; `None` if they sum to zero.
pub(super) fn merged<'a>(parts: impl Iterator<Item = (f64, &'a Normal)> + Clone) -> Option<Normal> {
    let total: f64 = parts.clone().map(|(weight, _)| weight).sum();
    let first = parts.clone().next()?.1;
    if total <= 0.0 || !total.is_finite() {
        return None;
    }
    let n = first.mean.len();
    let mut mean = vec![0.0; n];
    for (weight, part) in parts.clone() {
        let share = weight / total;
        mean.iter_mut().zip(&part.mean).for_each(|(sum, x)| *sum += share * x);
    }
    let (mut covariance, mut off) = (vec![0.0; n * n], vec![0.0; n]);
    for (weight, part) in parts {
        let share = weight / total;
        off.iter_mut()
            .enumerate()
            .for_each(|(i, off)| *off = part.mean[i] - mean[i]);
        for i in 0..n {
            let row = share * off[i];
            for j in 0..n {
                covariance[i * n + j] += share * part.covariance[i * n + j] + row * off[j];
            }
        }
    }
    Some(Normal {
        mean,
        covariance,
        axes: first.axes,
    })
}
