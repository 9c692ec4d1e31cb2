//! Places that explain a set of ranges: the grid of positions, and the filters of a place.

use super::fit::{Search, fit};
use super::gaussian::Normal;
use super::rows::{Collected, Rows, Slice};
use super::settings::Own;
use nalgebra::DMatrix;

/// Grid: nodes to either side of the middle, and from one to the next in deviations of the prior, for two coordinates and for three.
const NODES: [(i32, f64); 2] = [(12, 0.25), (6, 0.4)];
/// Local maxima of the grid that are refined, for each set of anchors.
const MAXIMA: usize = 4;
/// By how many nats one may be worse than the best: the grid's noise is large, with that of the ranges it is worse by more.
const NEGLIGIBLE_MAXIMUM: f64 = 14.0;
/// Of the noises, every so many are tried for a place.
const NOISES_TRIED: usize = 2;
/// Of so many noises or speeds all are in a place's bank from the first range on.
const FEW: usize = 5;
/// Filters whose ranges' variances differ by less than this factor have the same place.
const ALIKE: f64 = 1.2;
/// Slices to either side of the middle at most, and by how many nats one may be worse than the best.
const SLICES: i32 = 8;
const NEGLIGIBLE_SLICE: f64 = 6.0;

/// A place that explains some of the ranges.
#[derive(Clone)]
pub(super) struct Found {
    /// Index of the range that is left out.
    pub(super) without: Option<usize>,
    pub(super) normal: Normal,
    pub(super) log_evidence: f64,
    /// The noise with the largest evidence.
    noise: f64,
    slice: Option<Slice>,
}

impl Found {
    /// `ln` of its slice's share: slices a deviation apart share out all positions, and their densities sum to one over the deviation.
    pub(super) fn log_share(&self) -> f64 {
        self.slice.map_or(0.0, |slice| slice.deviation.ln())
    }
}

impl Search<'_> {
    /// `ln p(position, ranges)` up to a constant, with bias and scale integrated out one range after the other.
    fn at(&self, point: &[f64; 3], ranges: &[Collected], variance: f64) -> f64 {
        let [(bias, bias_variance), (scale, scale_variance)] = self.calibration;
        let (mut mean, mut p) = ([bias, scale], [bias_variance, 0.0, scale_variance]);
        let (mut total, relative) = (0.0, 1.0 / variance);
        for i in 0..self.axes() {
            let off = (point[i] - self.known.middle[i]) / self.known.spreads[i];
            total -= 0.5 * off * off;
        }
        // A product of few ratios does not overflow, and one logarithm is cheaper than many.
        let mut ratio = 1.0;
        for (number, one) in ranges.iter().enumerate() {
            let d = self.measured(point, one);
            let cross = [p[0] + d * p[1], p[1] + d * p[2]];
            let spread = cross[0] + d * cross[1] + variance;
            let off = one.range - (1.0 + mean[1]) * d - mean[0];
            let weight = 1.0 / spread;
            total -= 0.5 * off * off * weight;
            ratio *= spread * relative;
            if number % 8 == 7 || number + 1 == ranges.len() {
                total -= 0.5 * f64::ln(ratio);
                ratio = 1.0;
            }
            let gain = cross.map(|c| c * weight);
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
        let smooth = 0.5 * step * self.known.spreads[0] * self.known.size / self.known.anchors_spread;
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
        if let Some(highest) = found.first().map(|index| values[*index]) {
            found.retain(|index| values[*index] > highest - NEGLIGIBLE_MAXIMUM);
        }
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
        for noise in self.known.noises.iter().rev().step_by(NOISES_TRIED) {
            let Some((normal, log_evidence)) =
                fit(self, &from, &Rows::new(ranges, *noise, speed, None), speed, Own::Each(0.0))
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

    /// Cuts a place whose law is too long for one linearisation into slices across its longest direction, at most `finest` in a deviation of it. Empty
    /// if it is not.
    pub(super) fn sliced(&self, one: &Found, ranges: &[Collected], speed: f64, finest: f64) -> Vec<Found> {
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
        let noise =
            one.noise.max(self.known.noises[0]) / self.known.measured.slope(nearest.max(0.05 * self.known.spreads[0]));
        let wanted = (noise * nearest.max(0.05 * self.known.spreads[0])).sqrt();
        if length < wanted {
            return Vec::new();
        }
        let deviation = wanted.max(length / finest);
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
                let Some((normal, log_evidence)) = fit(self, &from, &rows, speed, Own::Each(0.0)) else {
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

    /// The evidence of a place and biases of single anchors, at the place's noise and a speed in the middle.
    pub(super) fn evidence(&self, one: &Found, ranges: &[Collected], own: Own) -> Option<f64> {
        let speed = self.known.speeds[self.known.speeds.len() / 2];
        let rows = Rows::new(ranges, one.noise, speed, one.slice);
        let (_, log_evidence) = fit(self, &one.normal.mean, &rows, speed, own)?;
        Some(log_evidence + one.log_share())
    }

    /// The filters of a place with their weights, and its evidence over all of them.
    pub(super) fn bank(&self, one: &Found, ranges: &[Collected], own: Own) -> Option<(Vec<Normal>, Vec<f64>, f64)> {
        let mut filters: Vec<Option<(Normal, f64)>> = Vec::new();
        // Of each fit the variances of the ranges, and its number.
        let mut fitted: Vec<(Vec<f64>, usize)> = Vec::new();
        // Of many, every second is tried, counted from the largest. Those between take their places if evidence is for them.
        let is_tried = |index: usize, count: usize| count <= FEW || (count - 1 - index).is_multiple_of(2);
        let (speeds, noises) = (&self.known.speeds, &self.known.noises);
        for (at, speed) in speeds.iter().enumerate() {
            for (of_speed, noise) in noises.iter().enumerate() {
                if !is_tried(at, speeds.len()) || !is_tried(of_speed, noises.len()) {
                    filters.push(None);
                    continue;
                }
                let variances: Vec<f64> = ranges
                    .iter()
                    .map(|range| {
                        noise * noise + (speed * range.age * range.slope).powi(2) + own.of(range.anchor).powi(2)
                    })
                    .collect();
                let is_alike = |known: &[f64]| {
                    let mut pairs = variances.iter().zip(known);
                    pairs.all(|(a, b)| *a < ALIKE * b && *b < ALIKE * a)
                };
                let same = fitted
                    .iter()
                    .find(|(known, _)| is_alike(known))
                    .map(|(_, number)| *number);
                let next = if let Some(number) = same {
                    filters[number].clone().map(|(mut normal, log_evidence)| {
                        let n = normal.mean.len();
                        (normal.axes..2 * normal.axes).for_each(|v| normal.covariance[v * n + v] = speed * speed);
                        (normal, log_evidence)
                    })
                } else {
                    fitted.push((variances, filters.len()));
                    let rows = Rows::new(ranges, *noise, *speed, one.slice);
                    fit(self, &one.normal.mean, &rows, *speed, own)
                };
                filters.push(next);
            }
        }
        let highest = filters
            .iter()
            .flatten()
            .map(|(_, log)| *log)
            .fold(f64::NEG_INFINITY, f64::max);
        if highest == f64::NEG_INFINITY {
            return None;
        }
        let weights: Vec<f64> = filters
            .iter()
            .map(|one| one.as_ref().map_or(0.0, |(_, log)| (log - highest).exp()))
            .collect();
        let total: f64 = weights.iter().sum();
        let log_evidence = highest + (total / weights.len() as f64).ln() + one.log_share();
        let filters = filters
            .into_iter()
            .map(|one| one.map_or_else(Normal::unknown, |(normal, _)| normal));
        Some((filters.collect(), weights.iter().map(|weight| weight / total).collect(), log_evidence))
    }
}
