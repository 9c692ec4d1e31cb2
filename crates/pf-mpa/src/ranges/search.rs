//! Places that explain a set of ranges, from starts, and the filters of a place.

use super::fit::{Search, fit};
use super::gaussian::Normal;
use super::rows::{Collected, Rows, Slice};
use super::settings::Own;
use nalgebra::DMatrix;

/// Of the noises, every so many are tried for a place.
const NOISES_TRIED: usize = 2;
/// Of so many noises or speeds all are in a place's bank from the first range on.
const FEW: usize = 5;
/// Filters whose ranges' variances differ by less than this factor have the same place.
const ALIKE: f64 = 1.2;
/// Slices to either side of the middle at most, and by how many nats one may be worse than the best.
const SLICES: i32 = 8;
const NEGLIGIBLE_SLICE: f64 = 6.0;

/// No biases of single anchors.
const NONE: Own = Own::Each(0.0);

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
                fit(self, &from, &Rows::new(ranges, *noise, speed, NONE, None), speed, NONE)
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
                let rows = Rows::new(ranges, one.noise, speed, NONE, Some(slice));
                let Some((normal, log_evidence)) = fit(self, &from, &rows, speed, NONE) else {
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
        let speed = self.known.speeds[self.known.middle_speed];
        let rows = Rows::new(ranges, one.noise, speed, own, one.slice);
        let (_, log_evidence) = fit(self, &one.normal.mean, &rows, speed, own)?;
        Some(log_evidence + one.log_share())
    }

    /// The filters of a place with their weights, and its evidence over all of them.
    pub(super) fn bank(&self, one: &Found, ranges: &[Collected], own: Own) -> Option<(Vec<Normal>, Vec<f64>, f64)> {
        let (speeds, noises) = (&self.known.speeds, &self.known.noises);
        let count = speeds.len() * noises.len();
        let (mut filters, mut logs) = (Vec::with_capacity(count), Vec::with_capacity(count));
        // Of each fit its number, and the variances of the ranges.
        let mut fitted: Vec<(usize, Rows<'_>)> = Vec::with_capacity(count);
        // Of many, every second is tried, counted from the largest. Those between take their places if evidence is for them.
        let is_tried = |index: usize, count: usize| count <= FEW || (count - 1 - index).is_multiple_of(2);
        // The place of one filter is the start of the next.
        let (mut near, mut first): (Option<usize>, Option<usize>) = (None, None);
        for (at, speed) in speeds.iter().enumerate() {
            near = first.take().or(near);
            for (of_speed, noise) in noises.iter().enumerate() {
                if !is_tried(at, speeds.len()) || !is_tried(of_speed, noises.len()) {
                    filters.push(Normal::unknown());
                    logs.push(f64::NEG_INFINITY);
                    continue;
                }
                let rows = Rows::new(ranges, *noise, *speed, own, one.slice);
                let is_alike = |known: &Rows<'_>| {
                    let mut pairs = rows.variances.iter().zip(&known.variances);
                    pairs.all(|(a, b)| *a < ALIKE * b && *b < ALIKE * a)
                };
                let number = filters.len();
                let (normal, log) = if let Some((same, _)) = fitted.iter().find(|(_, known)| is_alike(known)) {
                    let mut normal: Normal = filters[*same].clone();
                    let n = normal.mean.len();
                    (normal.axes..2 * normal.axes).for_each(|v| normal.covariance[v * n + v] = speed * speed);
                    (normal, logs[*same])
                } else {
                    let start = near.map_or(&one.normal.mean, |near| &filters[near].mean);
                    let found = fit(self, start, &rows, *speed, own);
                    fitted.push((number, rows));
                    found.unwrap_or((Normal::unknown(), f64::NEG_INFINITY))
                };
                if log.is_finite() {
                    (near, first) = (Some(number), first.or(Some(number)));
                }
                filters.push(normal);
                logs.push(log);
            }
        }
        let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if highest == f64::NEG_INFINITY {
            return None;
        }
        let mut weights = logs;
        weights
            .iter_mut()
            .for_each(|weight| *weight = (*weight - highest).exp());
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        let log_evidence = highest + (total / count as f64).ln() + one.log_share();
        Some((filters, weights, log_evidence))
    }
}
