//! Places that explain a set of ranges: the grid of positions, and the most probable state near a node.

use super::gaussian::Normal;
use super::rows::{Collected, Rows, Slice};
use super::settings::Known;
use nalgebra::{DMatrix, DVector};

/// Grid: nodes to either side of the middle, and from one to the next in deviations of the prior, for two coordinates and for three.
const NODES: [(i32, f64); 2] = [(12, 0.25), (6, 0.4)];
/// Local maxima of the grid that are refined, for each set of anchors.
const MAXIMA: usize = 4;
/// Gauss-Newton steps at most.
const STEPS: usize = 30;
/// Slices to either side of the middle at most, and by how many nats one may be worse than the best.
const SLICES: i32 = 8;
const NEGLIGIBLE_SLICE: f64 = 6.0;

/// What is known of bias and scale: mean and variance of each.
pub(super) type Calibration = [(f64, f64); 2];

/// What is known before the ranges.
pub(super) struct Search<'a> {
    pub(super) known: &'a Known,
    pub(super) calibration: Calibration,
    pub(super) anchors: usize,
}

/// A place that explains some of the ranges.
pub(super) struct Found {
    /// Index of the range that is left out.
    pub(super) without: Option<usize>,
    pub(super) normal: Normal,
    pub(super) log_evidence: f64,
    /// The noise with the largest evidence.
    noise: f64,
    slice: Option<Slice>,
}

impl Search<'_> {
    fn axes(&self) -> usize {
        self.known.axes
    }

    fn distance(&self, point: &[f64], one: &Collected) -> f64 {
        let squares: f64 = (0..self.axes()).map(|i| (point[i] - one.place[i]).powi(2)).sum();
        let above = if self.axes() == 2 {
            one.place[2] - self.known.level
        } else {
            0.0
        };
        (squares + above * above).sqrt()
    }

    /// `ln p(position, ranges)` up to a constant, with bias and scale integrated out one range after the other.
    fn at(&self, point: &[f64; 3], ranges: &[Collected], variance: f64) -> f64 {
        let [(bias, bias_variance), (scale, scale_variance)] = self.calibration;
        let (mut mean, mut p) = ([bias, scale], [bias_variance, 0.0, scale_variance]);
        let mut total = 0.0;
        for i in 0..self.axes() {
            let off = (point[i] - self.known.middle[i]) / self.known.spreads[i];
            total -= 0.5 * off * off;
        }
        for one in ranges {
            let d = self.distance(point, one);
            let cross = [p[0] + d * p[1], p[1] + d * p[2]];
            let spread = cross[0] + d * cross[1] + variance;
            let off = one.range - (1.0 + mean[1]) * d - mean[0];
            total -= 0.5 * (off * off / spread + spread.ln());
            let gain = cross.map(|c| c / spread);
            mean = [mean[0] + gain[0] * off, mean[1] + gain[1] * off];
            p = [
                p[0] - gain[0] * cross[0],
                p[1] - gain[0] * cross[1],
                p[2] - gain[1] * cross[1],
            ];
        }
        total
    }

    /// Local maxima over the grid, the best first.
    pub(super) fn maxima(&self, ranges: &[Collected]) -> Vec<[f64; 3]> {
        let axes = self.axes();
        let (nodes, step) = NODES[axes - 2];
        let width = (2 * nodes + 1) as usize;
        let count = width.pow(axes as u32);
        // Half a step: between two nodes the likelihood must not vanish.
        let smooth = 0.5 * step * self.known.spreads[0];
        let largest = self.known.noises.iter().fold(0.0_f64, |most, noise| most.max(*noise));
        let variance = smooth * smooth + (0.25 * largest).powi(2).min(smooth * smooth);
        let place = |index: usize| {
            let mut point = [0.0; 3];
            let mut rest = index;
            for (i, x) in point.iter_mut().enumerate().take(axes) {
                *x = self.known.middle[i] + f64::from((rest % width) as i32 - nodes) * step * self.known.spreads[i];
                rest /= width;
            }
            point
        };
        let values: Vec<f64> = (0..count)
            .map(|index| self.at(&place(index), ranges, variance))
            .collect();
        let is_highest = |index: usize| {
            let mut stride = 1;
            for _ in 0..axes {
                let at = index / stride % width;
                if at > 0 && values[index - stride] > values[index]
                    || at + 1 < width && values[index + stride] > values[index]
                {
                    return false;
                }
                stride *= width;
            }
            true
        };
        let mut found: Vec<usize> = (0..count)
            .filter(|index| values[*index].is_finite() && is_highest(*index))
            .collect();
        found.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        found.truncate(MAXIMA);
        // The grid is coarse beside the prior of a height, and anchors of like heights have a second place on their other side.
        let heights: &[f64] = if axes == 3 { &[0.0, -1.0, 1.0] } else { &[0.0] };
        let beside = |index: usize| {
            heights.iter().map(move |off| {
                let [x, y, z] = place(index);
                [x, y, z + off * self.known.spreads[2]]
            })
        };
        found.into_iter().flat_map(beside).collect()
    }

    /// Mean and variances of the state before the first range.
    fn prior(&self, speed: f64, own: f64) -> (Vec<f64>, Vec<f64>) {
        let axes = self.axes();
        let size = 2 * axes + 2 + if own > 0.0 { self.anchors } else { 0 };
        let (mut mean, mut variances) = (vec![0.0; size], vec![own * own; size]);
        for i in 0..axes {
            (mean[i], variances[i]) = (self.known.middle[i], self.known.spreads[i].powi(2));
            variances[axes + i] = speed * speed;
        }
        for (i, (middle, variance)) in self.calibration.into_iter().enumerate() {
            (mean[2 * axes + i], variances[2 * axes + i]) = (middle, variance);
        }
        (mean, variances)
    }

    /// The most probable state near a start, its covariance there, and the evidence, in a slice of the positions if there is one. `None` if the
    /// covariance of the ranges is singular.
    fn fit(&self, start: &[f64], rows: &Rows<'_>, speed: f64, own: f64) -> Option<(Normal, f64)> {
        let axes = self.axes();
        let (middle, variances) = self.prior(speed, own);
        let size = middle.len();
        let (middle, variances) = (DVector::from_vec(middle), DVector::from_vec(variances));
        let mut deviations = rows.deviations.clone();
        deviations.extend(rows.slice.map(|slice| slice.deviation));
        let count = deviations.len();
        let ranges_at = |x: &DVector<f64>| {
            let mut jacobian = DMatrix::<f64>::zeros(count, size);
            let mut off = DVector::<f64>::zeros(count);
            for (row, one) in rows.ranges.iter().enumerate() {
                let d = self.distance(x.as_slice(), one);
                let factor = 1.0 + x[2 * axes + 1];
                for i in 0..axes {
                    jacobian[(row, i)] = if d > 0.0 {
                        factor * (x[i] - one.place[i]) / d
                    } else {
                        0.0
                    };
                }
                (jacobian[(row, 2 * axes)], jacobian[(row, 2 * axes + 1)]) = (1.0, d);
                let mut expected = factor * d + x[2 * axes];
                if own > 0.0 {
                    let at = 2 * axes + 2 + one.anchor;
                    jacobian[(row, at)] = 1.0;
                    expected += x[at];
                }
                off[row] = one.range - expected;
            }
            if let Some(slice) = rows.slice {
                let along: f64 = (0..axes).map(|i| slice.direction[i] * x[i]).sum();
                (0..axes).for_each(|i| jacobian[(count - 1, i)] = slice.direction[i]);
                off[count - 1] = slice.middle - along;
            }
            (jacobian, off)
        };
        let cost = |x: &DVector<f64>, off: &DVector<f64>| {
            let prior: f64 = (0..size)
                .filter(|i| variances[*i] > 0.0)
                .map(|i| (x[i] - middle[i]).powi(2) / variances[i])
                .sum();
            prior
                + off
                    .iter()
                    .zip(&deviations)
                    .map(|(off, deviation)| (off / deviation).powi(2))
                    .sum::<f64>()
        };
        let mut x = middle.clone();
        x.as_mut_slice()[..axes].copy_from_slice(&start[..axes]);
        let (mut jacobian, mut off) = ranges_at(&x);
        let mut best = cost(&x, &off);
        for _ in 0..STEPS {
            let spread = innovation(&jacobian, &variances, &deviations)?;
            let from_middle = &off - &jacobian * (&middle - &x);
            let target = &middle + variances.component_mul(&(jacobian.transpose() * spread.solve(&from_middle)));
            let whole = target - &x;
            let (mut has_moved, mut share) = (false, 1.0);
            while share > 1e-4 {
                let next = &x + &whole * share;
                let (next_jacobian, next_off) = ranges_at(&next);
                let found = cost(&next, &next_off);
                if found < best {
                    has_moved = best - found > 1e-7 * (1.0 + found);
                    (x, jacobian, off, best) = (next, next_jacobian, next_off, found);
                    break;
                }
                share *= 0.5;
            }
            if !has_moved {
                break;
            }
        }
        let spread = innovation(&jacobian, &variances, &deviations)?;
        let from_middle = &off - &jacobian * (&middle - &x);
        let log_determinant: f64 = spread.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        let constants = log_determinant + count as f64 * std::f64::consts::TAU.ln();
        let log_evidence = -0.5 * (from_middle.dot(&spread.solve(&from_middle)) + constants);
        let cross = DMatrix::from_fn(size, count, |i, j| variances[i] * jacobian[(j, i)]);
        let covariance = DMatrix::from_diagonal(&variances) - &cross * spread.solve(&cross.transpose());
        let normal = Normal {
            mean: x.as_slice().to_vec(),
            covariance: (0..size * size)
                .map(|k| 0.5 * (covariance[k] + covariance[k % size * size + k / size]))
                .collect(),
            axes,
        };
        (normal.is_finite() && log_evidence.is_finite()).then_some((normal, log_evidence))
    }

    /// The most probable place near a start, over all noises.
    pub(super) fn best(
        &self,
        start: &[f64],
        ranges: &[Collected],
        without: Option<usize>,
        speed: f64,
    ) -> Option<Found> {
        let mut best: Option<Found> = None;
        let mut from = start.to_vec();
        // From the largest noise down: the place of one is the start of the next.
        for noise in self.known.noises.iter().rev() {
            let Some((normal, log_evidence)) = self.fit(&from, &Rows::new(ranges, *noise, speed, None), speed, 0.0)
            else {
                continue;
            };
            from.clone_from(&normal.mean);
            if best.as_ref().is_none_or(|best| log_evidence > best.log_evidence) {
                best = Some(Found {
                    without,
                    normal,
                    log_evidence,
                    noise: *noise,
                    slice: None,
                });
            }
        }
        best
    }

    /// Cuts a place whose law is too long for one linearisation into slices across its longest direction. Empty if it is not.
    pub(super) fn sliced(&self, one: &Found, ranges: &[Collected], speed: f64) -> Vec<Found> {
        let (n, axes) = (one.normal.mean.len(), self.axes());
        let positions = DMatrix::from_fn(axes, axes, |i, j| one.normal.covariance[i * n + j]);
        let eigen = positions.symmetric_eigen();
        let (longest, variance) = eigen.eigenvalues.argmax();
        let length = variance.max(0.0).sqrt();
        let nearest = ranges
            .iter()
            .map(|range| self.distance(&one.normal.mean, range))
            .fold(f64::INFINITY, f64::min);
        // At the end of a slice the distance may differ from the linearised one by half of the noise.
        let noise = one.noise.max(self.known.noises[0]);
        let wanted = (noise * nearest.max(0.05 * self.known.spreads[0])).sqrt();
        if length < wanted {
            return Vec::new();
        }
        let deviation = wanted.max(length / 4.0);
        let mut direction = [0.0; 3];
        (0..axes).for_each(|i| direction[i] = eigen.eigenvectors[(i, longest)]);
        let middle: f64 = (0..axes).map(|i| direction[i] * one.normal.mean[i]).sum();
        let mut found: Vec<Found> = Vec::new();
        let mut highest = f64::NEG_INFINITY;
        for sign in [1.0, -1.0] {
            let mut from = one.normal.mean.clone();
            for k in i32::from(sign < 0.0)..SLICES {
                let slice = Slice {
                    direction,
                    middle: middle + sign * f64::from(k) * deviation,
                    deviation,
                };
                let rows = Rows::new(ranges, one.noise, speed, Some(slice));
                let Some((normal, log_evidence)) = self.fit(&from, &rows, speed, 0.0) else {
                    break;
                };
                from.clone_from(&normal.mean);
                highest = highest.max(log_evidence);
                if log_evidence < highest - NEGLIGIBLE_SLICE {
                    break;
                }
                found.push(Found {
                    without: one.without,
                    normal,
                    log_evidence,
                    noise: one.noise,
                    slice: Some(slice),
                });
            }
        }
        found.retain(|slice| slice.log_evidence > highest - NEGLIGIBLE_SLICE);
        found
    }

    /// The filters of a place with their weights, and its evidence over all of them.
    pub(super) fn bank(&self, one: &Found, ranges: &[Collected], own: f64) -> Option<(Vec<Normal>, Vec<f64>, f64)> {
        let oldest = ranges.iter().fold(0.0_f64, |most, range| most.max(range.age));
        let mut filters: Vec<Option<(Normal, f64)>> = Vec::new();
        for speed in &self.known.speeds {
            for (i, noise) in self.known.noises.iter().enumerate() {
                // Ranges that are nearly of one time fit the same place at every speed.
                let same = filters
                    .get(i)
                    .filter(|_| (speed * oldest).powi(2) < 0.05 * noise * noise);
                let next = match same {
                    Some(Some((normal, log_evidence))) => {
                        let mut normal = normal.clone();
                        let n = normal.mean.len();
                        (normal.axes..2 * normal.axes).for_each(|v| normal.covariance[v * n + v] = speed * speed);
                        Some((normal, *log_evidence))
                    }
                    _ => self.fit(&one.normal.mean, &Rows::new(ranges, *noise, *speed, one.slice), *speed, own),
                };
                filters.push(next);
            }
        }
        let highest = filters
            .iter()
            .flatten()
            .map(|(_, log)| *log)
            .fold(f64::NEG_INFINITY, f64::max);
        let (stand_in, _) = filters.iter().flatten().find(|(_, log)| *log == highest).cloned()?;
        let weights: Vec<f64> = filters
            .iter()
            .map(|one| one.as_ref().map_or(0.0, |(_, log)| (log - highest).exp()))
            .collect();
        let total: f64 = weights.iter().sum();
        // Slices a deviation apart share out all positions: their densities sum to one over the deviation.
        let share = one.slice.map_or(0.0, |slice| slice.deviation.ln());
        let log_evidence = highest + (total / weights.len() as f64).ln() + share;
        let filters = filters
            .into_iter()
            .map(|one| one.map_or_else(|| stand_in.clone(), |(normal, _)| normal));
        Some((filters.collect(), weights.iter().map(|weight| weight / total).collect(), log_evidence))
    }
}

fn innovation(
    jacobian: &DMatrix<f64>,
    variances: &DVector<f64>,
    deviations: &[f64],
) -> Option<nalgebra::Cholesky<f64, nalgebra::Dyn>> {
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| jacobian[(i, j)] * variances[j]);
    let mut spread = scaled * jacobian.transpose();
    for (i, deviation) in deviations.iter().enumerate() {
        spread[(i, i)] += deviation * deviation;
    }
    spread.cholesky()
}
