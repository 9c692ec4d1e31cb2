//! The grid of positions on which places are looked for.

use super::fit::{Calibration, Search};
use super::rows::Collected;
use super::settings::Known;

/// Nodes to either side of the middle, and from one to the next in deviations of the prior, for two coordinates and for three.
const NODES: [(i32, f64); 2] = [(12, 0.25), (6, 0.4)];
/// Local maxima that are refined, for each set of anchors.
const MAXIMA: usize = 4;
/// By how many nats one may be worse than the best: the grid's noise is large, with that of the ranges it is worse by more.
const NEGLIGIBLE_MAXIMUM: f64 = 14.0;

/// Positions, and what is measured at each of them: the same for all sets of ranges.
pub(super) struct Grid<'a> {
    known: &'a Known,
    ranges: &'a [Collected],
    points: Vec<[f64; 3]>,
    /// Of each point which it is along each axis.
    numbers: Vec<[i32; 3]>,
    /// Half of the squared distance from the middle, in deviations of the prior.
    priors: Vec<f64>,
    /// Range by range, for each the points.
    measured: Vec<Vec<f64>>,
    /// Variance of a range's error on the grid.
    variance: f64,
}

impl<'a> Grid<'a> {
    pub(super) fn new(search: &Search<'a>, ranges: &'a [Collected]) -> Self {
        let (known, axes) = (search.known, search.axes());
        let (nodes, step) = NODES[axes - 2];
        let width = 2 * nodes + 1;
        let count = width.pow(axes as u32);
        let numbers: Vec<[i32; 3]> = (0..count)
            .map(|index| [index % width, index / width % width, index / width / width])
            .collect();
        let (mut points, mut priors) = (Vec::new(), Vec::new());
        for numbers in &numbers {
            let (mut point, mut prior) = ([0.0; 3], 0.0);
            for (i, number) in numbers.iter().enumerate().take(axes) {
                let off = f64::from(number - nodes) * step;
                point[i] = known.middle[i] + off * known.spreads[i];
                prior += 0.5 * off * off;
            }
            points.push(point);
            priors.push(prior);
        }
        let of = |one: &Collected| points.iter().map(|point| search.measured(point, one)).collect();
        // Half a step: between two nodes the likelihood must not vanish.
        let smooth = 0.5 * step * known.spreads[0] * known.size / known.anchors_spread;
        let largest = known.noises.iter().fold(0.0_f64, |most, noise| most.max(*noise));
        Self {
            measured: ranges.iter().map(of).collect(),
            known,
            ranges,
            points,
            numbers,
            priors,
            variance: smooth * smooth + (0.25 * largest).powi(2).min(smooth * smooth),
        }
    }

    /// `ln p(position, ranges)` at all points, up to a constant, with bias and scale integrated out one range after the other.
    fn values(&self, calibration: &Calibration, without: Option<usize>) -> Vec<f64> {
        let [(bias, bias_variance), (scale, scale_variance)] = *calibration;
        let relative = 1.0 / self.variance;
        let all = self.ranges.iter().zip(&self.measured).enumerate();
        let used: Vec<(f64, &[f64])> = all
            .filter(|(number, _)| Some(*number) != without)
            .map(|(_, (one, measured))| (one.range, &measured[..self.points.len()]))
            .collect();
        let value = |(point, prior): (usize, &f64)| {
            let (mut mean, mut p) = ([bias, scale], [bias_variance, 0.0, scale_variance]);
            // A product of few ratios does not overflow, and one logarithm is cheaper than many.
            let (mut total, mut ratio) = (-prior, 1.0);
            for (number, (range, measured)) in used.iter().enumerate() {
                let d = measured[point];
                let cross = [p[0] + d * p[1], p[1] + d * p[2]];
                let spread = cross[0] + d * cross[1] + self.variance;
                let off = range - (1.0 + mean[1]) * d - mean[0];
                let weight = 1.0 / spread;
                total -= 0.5 * off * off * weight;
                ratio *= spread * relative;
                if number % 8 == 7 {
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
            total - 0.5 * f64::ln(ratio)
        };
        self.priors.iter().enumerate().map(value).collect()
    }

    /// Local maxima of the density of positions, given all ranges or all but one, the best first.
    pub(super) fn maxima(&self, calibration: &Calibration, without: Option<usize>) -> Vec<[f64; 3]> {
        let axes = self.known.axes;
        let last = 2 * NODES[axes - 2].0;
        let values = self.values(calibration, without);
        let is_highest = |index: usize| {
            let mut stride = 1;
            for at in &self.numbers[index][..axes] {
                if *at > 0 && values[index - stride] > values[index]
                    || *at < last && values[index + stride] > values[index]
                {
                    return false;
                }
                stride *= last as usize + 1;
            }
            true
        };
        let mut found: Vec<usize> = (0..values.len())
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
                let [x, y, z] = self.points[index];
                [x, y, z + off * self.known.spreads[2]]
            })
        };
        found.into_iter().flat_map(beside).collect()
    }
}
