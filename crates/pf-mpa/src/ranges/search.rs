//! Places that explain a set of ranges, from starts, and the filters of a place.

use super::fit::{Peak, Search, peak};
use super::gaussian::Normal;
use super::own::Own;
use super::rows::{Collected, Rows, Slice};
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
        let mut best: Option<(Peak, f64)> = None;
        let mut from: Option<Peak> = None;
        // From the largest noise down: the place of one is the start of the next.
        for noise in self.known.noises.iter().rev().step_by(NOISES_TRIED) {
            let near = from.as_ref().map_or(start, |from| from.start(self.axes()));
            let Some(found) = peak(self, near, &Rows::new(ranges, *noise, speed, NONE, None)) else {
                continue;
            };
            from = Some(found);
            if best.is_none_or(|(best, _)| found.log_evidence > best.log_evidence) {
                best = Some((found, *noise));
            }
        }
        let (best, noise) = best?;
        Some(Found {
            without,
            normal: best.law(self, &Rows::new(ranges, noise, speed, NONE, None), speed, NONE)?,
            log_evidence: best.log_evidence,
            noise,
            slice: None,
        })
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
                let Some(found_peak) = peak(self, &from, &rows) else {
                    break;
                };
                let log_evidence = found_peak.log_evidence;
                let Some(normal) = found_peak.law(self, &rows, speed, NONE) else {
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
        Some(peak(self, &one.normal.mean, &rows)?.log_evidence + one.log_share())
    }

    /// The peaks of the filters of a place with their weights, and its evidence over all of them.
    pub(super) fn bank(&self, one: &Found, ranges: &[Collected], own: Own) -> Option<Bank> {
        let (speeds, noises) = (&self.known.speeds, &self.known.noises);
        let count = speeds.len() * noises.len();
        // Of many, every second is tried, counted from the largest. Those between take their places if evidence is for them.
        let is_tried = |index: usize, count: usize| count <= FEW || (count - 1 - index).is_multiple_of(2);
        let tried = |list: &[f64]| (0..list.len()).filter(|i| is_tried(*i, list.len())).count();
        let mut peaks: Vec<(usize, Peak)> = Vec::with_capacity(tried(speeds) * tried(noises));
        // Of each fit its peak, and the variances of the ranges.
        let mut fitted: Vec<(Option<Peak>, Rows<'_>)> = Vec::with_capacity(peaks.capacity());
        // The place of one filter is the start of the next.
        let (mut near, mut first): (Option<Peak>, Option<Peak>) = (None, None);
        for (at, speed) in speeds.iter().enumerate().filter(|(at, _)| is_tried(*at, speeds.len())) {
            near = first.take().or(near);
            for (of_speed, noise) in noises.iter().enumerate().filter(|(at, _)| is_tried(*at, noises.len())) {
                let rows = Rows::new(ranges, *noise, *speed, own, one.slice);
                let is_alike = |known: &Rows<'_>| {
                    let mut pairs = rows.variances.iter().zip(&known.variances);
                    pairs.all(|(a, b)| *a < ALIKE * b && *b < ALIKE * a)
                };
                let found = if let Some((same, _)) = fitted.iter().find(|(_, known)| is_alike(known)) {
                    *same
                } else {
                    let start = near
                        .as_ref()
                        .map_or(&one.normal.mean[..], |near| near.start(self.axes()));
                    let found = peak(self, start, &rows);
                    fitted.push((found, rows));
                    found
                };
                if let Some(found) = found {
                    (near, first) = (Some(found), first.or(Some(found)));
                    peaks.push((at * noises.len() + of_speed, found));
                }
            }
        }
        let logs = peaks.iter().map(|(_, peak)| peak.log_evidence);
        let highest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
        if highest == f64::NEG_INFINITY {
            return None;
        }
        let mut weights: Vec<f64> = logs.map(|log| (log - highest).exp()).collect();
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        let log_evidence = highest + (total / count as f64).ln() + one.log_share();
        Some(Bank {
            peaks,
            weights,
            log_evidence,
        })
    }

    /// The laws of a bank's filters, and their weights: those of less than the weight `least` are left out.
    pub(super) fn laws(
        &self,
        bank: &Bank,
        one: &Found,
        ranges: &[Collected],
        own: Own,
        least: f64,
    ) -> (Vec<Normal>, Vec<f64>) {
        let (speeds, noises) = (&self.known.speeds, &self.known.noises);
        let count = speeds.len() * noises.len();
        let least = bank.weights.iter().copied().fold(0.0, f64::max).min(least);
        let (mut laws, mut weights) = (Vec::with_capacity(count), vec![0.0; count]);
        laws.resize_with(count, Normal::unknown);
        let mut last: Option<(&Peak, usize)> = None;
        for ((number, peak), weight) in bank
            .peaks
            .iter()
            .zip(&bank.weights)
            .filter(|(_, weight)| **weight >= least)
        {
            let (speed, noise) = (speeds[number / noises.len()], noises[number % noises.len()]);
            let found = match last.filter(|(other, _)| other.is_same(peak)) {
                Some((_, same)) => {
                    let mut same: Normal = laws[same].clone();
                    same.set_speed(speed);
                    Some(same)
                }
                None => peak.law(self, &Rows::new(ranges, noise, speed, own, one.slice), speed, own),
            };
            if let Some(found) = found {
                (laws[*number], weights[*number]) = (found, *weight);
                last = Some((peak, *number));
            }
        }
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        (laws, weights)
    }
}

/// The filters of a place before their laws are built.
pub(super) struct Bank {
    /// Numbers and peaks of the filters that were tried.
    peaks: Vec<(usize, Peak)>,
    weights: Vec<f64>,
    pub(super) log_evidence: f64,
}
