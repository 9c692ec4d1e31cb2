//! All places that explain the first ranges.
//!
//! ```text
//! for all ranges, and for all but those of one anchor:
//!     on a grid of positions p:  ln p(p | ranges); bias and scale are integrated out, since ranges are linear in them
//!     at each local maximum:     the most probable state by Gauss-Newton steps, for each noise; its covariance and evidence there
//! keep:  the places whose evidence is not negligible beside the best, each as one hypothesis
//! ```
//! Anchors on a circle have a second place, the inverse of the first in that circle: its ranges differ by a factor only. Which of the two it is
//! is decided by the prior of scale and bias alone, so both are kept while both are probable.

use super::bank::Hypothesis;
use super::gaussian::Normal;
use super::settings::Known;
use nalgebra::{DMatrix, DVector};

/// Grid: nodes to either side of the middle, and from one to the next in deviations of the prior, for two coordinates and for three.
const NODES: [(i32, f64); 2] = [(12, 0.25), (6, 0.4)];
/// Local maxima of the grid that are refined, for each set of anchors.
const MAXIMA: usize = 4;
/// Sets and places that become hypotheses at most, and by how many nats they may be worse than the best.
const KEPT: usize = 6;
const WORSE: f64 = 14.0;
/// Prior probability that the range of an anchor does not depend on the distance beside that of an outlier.
const BAD_ANCHOR: f64 = 0.01;
/// Probability that an anchor is good before its first range, and after a first range that was an outlier.
const GOOD: f64 = 0.99;
const GOOD_AFTER_OUTLIER: f64 = 0.6;
/// Gauss-Newton steps at most.
const STEPS: usize = 30;
/// Two places are the same if they differ by less than this many deviations.
const SAME: f64 = 1.0;

/// The latest range of an anchor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Collected {
    pub(super) anchor: usize,
    pub(super) place: [f64; 3],
    pub(super) range: f64,
    /// Seconds since it was taken.
    pub(super) age: f64,
}

/// What is known of bias and scale: mean and variance of each.
pub(super) type Calibration = [(f64, f64); 2];

struct Search<'a> {
    known: &'a Known,
    calibration: Calibration,
    anchors: usize,
}

/// A place that explains some of the ranges.
struct Found {
    /// Index of the range that is left out.
    without: Option<usize>,
    normal: Normal,
    log_evidence: f64,
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
    fn maxima(&self, ranges: &[Collected]) -> Vec<[f64; 3]> {
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
        found.into_iter().map(place).collect()
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

    /// The most probable state near a start, its covariance there, and the evidence. `None` if the ranges decide nothing there.
    fn fit(
        &self,
        start: &[f64],
        ranges: &[Collected],
        deviations: &[f64],
        speed: f64,
        own: f64,
    ) -> Option<(Normal, f64)> {
        let (axes, count) = (self.axes(), ranges.len());
        let (middle, variances) = self.prior(speed, own);
        let size = middle.len();
        let (middle, variances) = (DVector::from_vec(middle), DVector::from_vec(variances));
        let ranges_at = |x: &DVector<f64>| {
            let mut jacobian = DMatrix::<f64>::zeros(count, size);
            let mut off = DVector::<f64>::zeros(count);
            for (row, one) in ranges.iter().enumerate() {
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
                    .zip(deviations)
                    .map(|(off, deviation)| (off / deviation).powi(2))
                    .sum::<f64>()
        };
        let mut x = middle.clone();
        x.as_mut_slice()[..axes].copy_from_slice(&start[..axes]);
        let (mut jacobian, mut off) = ranges_at(&x);
        let mut best = cost(&x, &off);
        for _ in 0..STEPS {
            let gain = self.innovation(&jacobian, &variances, deviations)?;
            let innovation = &off - &jacobian * (&middle - &x);
            let target = &middle + variances.component_mul(&(jacobian.transpose() * gain.solve(&innovation)));
            let whole = target - &x;
            let mut moved = false;
            let mut share = 1.0;
            while share > 1e-4 {
                let next = &x + &whole * share;
                let (next_jacobian, next_off) = ranges_at(&next);
                let found = cost(&next, &next_off);
                if found < best {
                    moved = best - found > 1e-7 * (1.0 + found);
                    (x, jacobian, off, best) = (next, next_jacobian, next_off, found);
                    break;
                }
                share *= 0.5;
            }
            if !moved {
                break;
            }
        }
        let gain = self.innovation(&jacobian, &variances, deviations)?;
        let innovation = &off - &jacobian * (&middle - &x);
        let log_determinant: f64 = gain.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        let solved = gain.solve(&innovation);
        let log_evidence =
            -0.5 * (innovation.dot(&solved) + log_determinant + count as f64 * std::f64::consts::TAU.ln());
        let cross = DMatrix::from_fn(size, count, |i, j| variances[i] * jacobian[(j, i)]);
        let covariance = DMatrix::from_diagonal(&variances) - &cross * gain.solve(&cross.transpose());
        let normal = Normal {
            mean: x.as_slice().to_vec(),
            covariance: (0..size * size)
                .map(|k| 0.5 * (covariance[k] + covariance[k % size * size + k / size]))
                .collect(),
            axes,
        };
        (normal.is_finite() && log_evidence.is_finite()).then_some((normal, log_evidence))
    }

    fn innovation(
        &self,
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
}

/// Whether two laws are about the same position.
pub(super) fn is_same(a: &Normal, b: &Normal) -> bool {
    (0..a.axes).all(|i| (a.mean[i] - b.mean[i]).powi(2) <= SAME * SAME * a.variance(i).max(b.variance(i)))
}

/// The hypotheses that explain the latest range of each anchor, the most probable first. None if no place does.
pub(super) fn hypotheses(
    known: &Known,
    anchors: usize,
    calibration: Calibration,
    collected: &[Collected],
) -> Vec<Hypothesis> {
    let mut collected = collected.to_vec();
    let mut calibration = calibration;
    if let Some(clock) = known.clock {
        // The middle of the bias: what makes the ranges lengths of the size of the room.
        let mean = collected.iter().map(|one| one.range).sum::<f64>() / collected.len().max(1) as f64;
        calibration[0] = (mean, clock * clock);
    }
    let search = Search {
        known,
        calibration,
        anchors,
    };
    let least = known.axes + 1;
    let typical = known.speeds[known.speeds.len() / 2];
    let deviations = |ranges: &[Collected], noise: f64, speed: f64| -> Vec<f64> {
        ranges.iter().map(|one| noise.hypot(speed * one.age)).collect()
    };
    let rows = std::mem::take(&mut collected);
    let left = |without: Option<usize>| -> Vec<Collected> {
        rows.iter()
            .enumerate()
            .filter(|(i, _)| Some(*i) != without)
            .map(|(_, one)| *one)
            .collect()
    };
    // An outlier, or an anchor whose ranges say nothing, is as probable as `bad`, and its range as `1 / stray`.
    let bad = known.outliers + BAD_ANCHOR;
    let mut found: Vec<Found> = Vec::new();
    let singles = if rows.len() > least { 0..rows.len() } else { 0..0 };
    for without in std::iter::once(None).chain(singles.map(Some)) {
        let ranges = left(without);
        let penalty = match without {
            None => ranges.len() as f64 * (1.0 - bad).ln(),
            Some(_) => (ranges.len() as f64) * (1.0 - bad).ln() + (bad / known.stray).ln(),
        };
        for start in search.maxima(&ranges) {
            let mut best: Option<Found> = None;
            let mut from = start.to_vec();
            // From the largest noise down: the place of one is the start of the next.
            for noise in known.noises.iter().rev() {
                let fitted = search.fit(&from, &ranges, &deviations(&ranges, *noise, typical), typical, 0.0);
                let Some((normal, log_evidence)) = fitted else { continue };
                from.clone_from(&normal.mean);
                let log_evidence = log_evidence + penalty;
                if best.as_ref().is_none_or(|best| log_evidence > best.log_evidence) {
                    best = Some(Found {
                        without,
                        normal,
                        log_evidence,
                    });
                }
            }
            let Some(best) = best else { continue };
            let twin = found
                .iter_mut()
                .find(|other| other.without == without && is_same(&other.normal, &best.normal));
            match twin {
                Some(twin) if best.log_evidence > twin.log_evidence => *twin = best,
                Some(_) => {}
                None => found.push(best),
            }
        }
    }
    found.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let Some(best) = found.first().map(|best| best.log_evidence) else {
        return Vec::new();
    };
    found.retain(|one| one.log_evidence > best - WORSE);
    found.truncate(KEPT);
    let mut all = Vec::new();
    for one in &found {
        let ranges = left(one.without);
        let good: Vec<f64> = (0..anchors)
            .map(|anchor| {
                let is_out = one.without.is_some_and(|i| rows[i].anchor == anchor);
                if is_out { GOOD_AFTER_OUTLIER } else { GOOD }
            })
            .collect();
        let penalty = match one.without {
            None => ranges.len() as f64 * (1.0 - bad).ln(),
            Some(_) => (ranges.len() as f64) * (1.0 - bad).ln() + (bad / known.stray).ln(),
        };
        for (variant, (own, probability)) in known.anchor_biases.iter().enumerate() {
            let oldest = ranges.iter().fold(0.0_f64, |most, range| most.max(range.age));
            let mut filters: Vec<Option<(Normal, f64)>> = Vec::new();
            for speed in &known.speeds {
                for (i, noise) in known.noises.iter().enumerate() {
                    // Ranges that are nearly of one time fit the same place at every speed.
                    let same = filters
                        .get(i)
                        .filter(|_| (speed * oldest).powi(2) < 0.05 * noise * noise);
                    let next = match same {
                        Some(Some((normal, log_evidence))) => {
                            let mut normal = normal.clone();
                            let n = normal.mean.len();
                            for v in normal.axes..2 * normal.axes {
                                normal.covariance[v * n + v] = speed * speed;
                            }
                            Some((normal, *log_evidence))
                        }
                        _ => search.fit(&one.normal.mean, &ranges, &deviations(&ranges, *noise, *speed), *speed, *own),
                    };
                    filters.push(next);
                }
            }
            let highest = filters
                .iter()
                .flatten()
                .map(|(_, log)| *log)
                .fold(f64::NEG_INFINITY, f64::max);
            let Some((stand_in, _)) = filters.iter().flatten().find(|(_, log)| *log == highest).cloned() else {
                continue;
            };
            let weights: Vec<f64> = filters
                .iter()
                .map(|one| one.as_ref().map_or(0.0, |(_, log)| (log - highest).exp()))
                .collect();
            let total: f64 = weights.iter().sum();
            let count = weights.len() as f64;
            let filters = filters
                .into_iter()
                .map(|one| one.map_or_else(|| stand_in.clone(), |(normal, _)| normal));
            let log_weight = highest + (total / count).ln() + penalty + probability.ln();
            let weights = weights.iter().map(|weight| weight / total).collect();
            all.push(Hypothesis::new(log_weight, filters.collect(), weights, good.clone(), variant));
        }
    }
    all.retain(Hypothesis::is_finite);
    all.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    all
}
