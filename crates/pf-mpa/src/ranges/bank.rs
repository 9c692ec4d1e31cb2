//! A hypothesis about the target: a bank of filters that differ in speed and noise, and how likely each anchor measures rightly.

use super::columns::Columns;
use super::gaussian::{Normal, merge_into};
use super::rest::Rest;
use super::settings::Known;
use super::step::Step;
use super::walk::Walk;

/// Probability per range that the speed changes: once in a few minutes. The noise is a property of the radio and changes less often.
const SPEED_CHANGES: f64 = 0.003;
const NOISE_CHANGES: f64 = 0.1 * SPEED_CHANGES;
/// Ranges between two changes: they are rare, so they are computed together.
const MIXED: u32 = 5;

/// One explanation of all ranges so far.
#[derive(Debug)]
pub(super) struct Hypothesis {
    /// `ln` of its probability, up to a constant of all.
    pub(super) log_weight: f64,
    /// Speed by speed, for each the noises. Those of weight 0 are left out: what they hold means nothing.
    pub(super) filters: Vec<Normal>,
    pub(super) weights: Vec<f64>,
    /// The filters whose weight is not zero, in order: few of many.
    pub(super) alive: Vec<usize>,
    /// Per anchor, the probability that its ranges depend on the distance.
    pub(super) good: Vec<f64>,
    /// Whether it is a piece of a curve of places: short enough that the error of scale is estimated though the ranges alone do not determine it.
    pub(super) is_cut: bool,
    /// Which supposition of single anchors' biases it has, and the anchor that alone has one.
    pub(super) variant: usize,
    pub(super) apart: Option<usize>,
    /// How the biases of single anchors walk, if they do.
    pub(super) walk: Option<Walk>,
    /// Probability that a range is no outlier, averaged over the latest ranges.
    pub(super) agreement: f64,
    /// Ranges in a row for which the anchors that are left did not determine the position.
    pub(super) contradicted: usize,
    /// Decaying `ln` evidence while the ranges do not determine the state, and by how much it counts.
    pub(super) recent: f64,
    pub(super) behind: f64,
    /// Per anchor, the decaying sum of scores and that of their variances.
    pub(super) scores: Vec<(f64, f64)>,
    ranges: u32,
    pub(super) rest: Rest,
    /// A filter of less weight is left out.
    pub(super) negligible: f64,
    /// The next range, by each filter that is not left out.
    pub(super) columns: Columns,
    /// A buffer.
    mixed: Vec<Mixed>,
}

/// A filter after a change from its neighbours.
#[derive(Debug)]
struct Mixed {
    weight: f64,
    law: Normal,
    is_new: bool,
}

impl Default for Mixed {
    fn default() -> Self {
        Self {
            weight: 0.0,
            law: Normal::unknown(),
            is_new: false,
        }
    }
}

impl Clone for Hypothesis {
    /// Filters that are left out are not copied.
    fn clone(&self) -> Self {
        let mut filters: Vec<Normal> = self.filters.iter().map(|_| Normal::unknown()).collect();
        for i in &self.alive {
            filters[*i].clone_from(&self.filters[*i]);
        }
        Self {
            log_weight: self.log_weight,
            filters,
            weights: self.weights.clone(),
            alive: self.alive.clone(),
            good: self.good.clone(),
            variant: self.variant,
            apart: self.apart,
            walk: self.walk,
            is_cut: self.is_cut,
            agreement: self.agreement,
            contradicted: self.contradicted,
            recent: self.recent,
            behind: self.behind,
            scores: self.scores.clone(),
            ranges: self.ranges,
            rest: self.rest,
            negligible: self.negligible,
            columns: Columns::default(),
            mixed: Vec::new(),
        }
    }

    /// The same into the buffers that are there.
    fn clone_from(&mut self, from: &Self) {
        self.log_weight = from.log_weight;
        self.weights.clone_from(&from.weights);
        self.alive.clone_from(&from.alive);
        self.good.clone_from(&from.good);
        (self.variant, self.apart, self.walk) = (from.variant, from.apart, from.walk);
        self.is_cut = from.is_cut;
        self.agreement = from.agreement;
        self.contradicted = from.contradicted;
        (self.recent, self.behind) = (from.recent, from.behind);
        self.scores.clone_from(&from.scores);
        (self.ranges, self.rest, self.negligible) = (from.ranges, from.rest, from.negligible);
        self.filters.resize_with(from.filters.len(), Normal::unknown);
        for i in &self.alive {
            self.filters[*i].clone_from(&from.filters[*i]);
        }
    }
}

impl Hypothesis {
    pub(super) fn new(
        log_weight: f64,
        filters: Vec<Normal>,
        weights: Vec<f64>,
        good: Vec<f64>,
        variant: usize,
    ) -> Self {
        let anchors = good.len();
        let mut made = Self {
            log_weight,
            filters,
            weights,
            alive: Vec::new(),
            good,
            variant,
            apart: None,
            walk: None,
            is_cut: false,
            agreement: 1.0,
            contradicted: 0,
            recent: 0.0,
            behind: 0.0,
            scores: vec![(0.0, 0.0); anchors],
            ranges: 0,
            rest: Rest::default(),
            negligible: 0.0,
            columns: Columns::default(),
            mixed: Vec::new(),
        };
        made.count_alive();
        made
    }

    /// Number of coordinates of the state.
    pub(super) fn size(&self) -> usize {
        self.alive.first().map_or(0, |i| self.filters[*i].mean.len())
    }

    fn count_alive(&mut self) {
        self.alive.clear();
        let positive = self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        self.alive.extend(positive.map(|(i, _)| i));
    }

    /// Moves all filters on, after speed and noise may have changed. `share`: its probability. The less
    /// it is, the fewer filters are kept.
    pub(super) fn predict(&mut self, known: &Known, step: &Step, share: f64) {
        // An anchor that is apart is improbable for long, and then needs the filters that were right all the time.
        let share = if self.apart.is_none() { share } else { 1.0 };
        self.negligible = known.least_weight(share);
        let (speeds, noises) = (known.speeds.len(), known.noises.len());
        self.ranges += 1;
        if self.ranges.is_multiple_of(MIXED) {
            let changes = |a_range: f64| -(f64::from(MIXED) * (-a_range).ln_1p()).exp_m1();
            for noise in 0..noises {
                if known.has_rest {
                    // A target that rested may move at any speed.
                    let pair = [0, known.middle_speed].map(|speed| speed * noises + noise);
                    self.mix(pair.into_iter(), changes(SPEED_CHANGES), self.negligible);
                }
                self.mix((0..speeds).map(|speed| speed * noises + noise), changes(SPEED_CHANGES), self.negligible);
            }
            for speed in 0..speeds {
                self.mix(speed * noises..(speed + 1) * noises, changes(NOISE_CHANGES), self.negligible);
            }
            self.count_alive();
        }
        self.carry(known, step, &[0.0; 3]);
    }

    /// Moves all filters on, and by a displacement.
    pub(super) fn carry(&mut self, known: &Known, step: &Step, by: &[f64; 3]) {
        for i in &self.alive {
            let (filter, speed) = (&mut self.filters[*i], known.bank[*i].speed);
            filter.predict(step, speed * speed);
            if let Some(walk) = &self.walk {
                walk.carry(filter, step);
            }
            let positions = filter.mean.iter_mut().take(known.axes);
            positions.zip(by).for_each(|(x, by)| *x += by);
        }
    }

    /// With probability `changes`, a filter becomes one of its two neighbours in a row of filters.
    fn mix(&mut self, row: impl Iterator<Item = usize> + Clone, changes: f64, negligible: f64) {
        if row.clone().nth(1).is_none() || row.clone().all(|i| self.weights[i] == 0.0) {
            return;
        }
        let mut next = std::mem::take(&mut self.mixed);
        next.resize_with(row.clone().count().max(next.len()), Mixed::default);
        let (mut before, mut after) = (None, row.clone().skip(1));
        for (i, mixed) in row.clone().zip(&mut next) {
            let neighbours = [before, after.next()];
            before = Some(i);
            let leaving = 0.5 * changes * neighbours.iter().flatten().count() as f64;
            let staying = (1.0 - leaving) * self.weights[i];
            let arriving = || {
                neighbours
                    .iter()
                    .flatten()
                    .map(|j| (0.5 * changes * self.weights[*j], *j))
                    .filter(|(weight, _)| *weight > 0.0)
            };
            let added: f64 = arriving().map(|(weight, _)| weight).sum();
            let total = staying + added;
            mixed.is_new = total >= negligible && added > negligible * staying && {
                let own = (staying > 0.0).then_some((staying, i));
                let parts = own.into_iter().chain(arriving());
                merge_into(parts.map(|(weight, j)| (weight, &self.filters[j])), &mut mixed.law)
            };
            let is_known = self.weights[i] > 0.0 || mixed.is_new;
            mixed.weight = if is_known { total } else { 0.0 };
        }
        for (i, mixed) in row.zip(&mut next) {
            self.weights[i] = mixed.weight;
            if mixed.is_new {
                std::mem::swap(&mut self.filters[i], &mut mixed.law);
            }
        }
        self.mixed = next;
    }

    /// Computes the moments of the next range of an anchor. `of_noise`: its noise as a share of the bank's. Returns its mean and variance with noise.
    pub(super) fn expect(&mut self, known: &Known, place: &[f64; 3], anchor: usize, of_noise: f64) -> (f64, f64) {
        let above = place[2] - known.level;
        let (mut mean, mut square) = (0.0, 0.0);
        let size = self.size();
        self.columns.clear(self.alive.len() * size);
        for (k, i) in self.alive.iter().enumerate() {
            let (weight, noise) = (self.weights[*i], of_noise * known.bank[*i].noise);
            let cross = &mut self.columns.cross[k * size..][..size];
            let found = self.filters[*i].range(known.measured, place, above, anchor, cross);
            let total = found.variance + noise * noise;
            self.columns.push(found, total);
            mean += weight * found.mean;
            square += weight * total;
        }
        let between = |(i, one): (&usize, &f64)| self.weights[*i] * (one - mean).powi(2);
        let filters = self.alive.iter().zip(&self.columns.mean);
        (mean, square + filters.map(between).sum::<f64>())
    }

    /// Gives all filters an unknown bias: with it the next range is as expected.
    pub(super) fn forget_bias(&mut self, known: &Known, deviation: f64, place: &[f64; 3], anchor: usize, range: f64) {
        let mut cross = vec![0.0; self.size()];
        for i in &self.alive {
            let filter = &mut self.filters[*i];
            let found = filter.range(known.measured, place, place[2] - known.level, anchor, &mut cross);
            let bias = filter.mean[filter.bias()] + range - found.mean;
            filter.forget_bias(bias, deviation * deviation);
        }
    }

    /// Number of anchors among `heard` whose ranges depend on the distance, without one whose bias is its own.
    pub(super) fn usable(&self, heard: impl Fn(usize) -> bool) -> usize {
        (0..self.good.len())
            .filter(|anchor| heard(*anchor) && self.good[*anchor] > 0.5 && self.apart != Some(*anchor))
            .count()
    }

    /// How much the scores of all anchors differ from independent ones of mean zero, in standard deviations of the sum of their squares
    /// (Wilson and Hilferty's approximation).
    pub(super) fn misfit(&self) -> f64 {
        let heard = self.scores.iter().filter(|(_, variance)| *variance > 0.0);
        let (sum, count) =
            heard.fold((0.0, 0.0), |(sum, count), (score, variance)| (sum + score * score / variance, count + 1.0));
        if count == 0.0 {
            return 0.0;
        }
        let variance = 2.0 / (9.0 * count);
        ((sum / count).cbrt() - (1.0 - variance)) / variance.sqrt()
    }

    /// The common moments of some coordinates: mean, and covariance row by row.
    pub(super) fn marginal<const N: usize>(&self, coordinates: &[usize; N]) -> ([f64; N], [[f64; N]; N]) {
        let (mut mean, mut covariance) = ([0.0; N], [[0.0; N]; N]);
        let total: f64 = self.parts().map(|(weight, _)| weight).sum();
        for (weight, part) in self.parts() {
            let share = weight / total;
            for (sum, i) in mean.iter_mut().zip(coordinates) {
                *sum += share * part.mean[*i];
            }
        }
        for (weight, part) in self.parts() {
            let (share, n) = (weight / total, part.mean.len());
            let mut off = [0.0; N];
            for ((off, mean), i) in off.iter_mut().zip(&mean).zip(coordinates) {
                *off = part.mean[*i] - mean;
            }
            for a in 0..N {
                let row = &part.covariance[coordinates[a] * n..][..n];
                for b in 0..=a {
                    covariance[a][b] += share * (row[coordinates[b]] + off[a] * off[b]);
                }
            }
        }
        for a in 0..N {
            for b in 0..a {
                covariance[b][a] = covariance[a][b];
            }
        }
        (mean, covariance)
    }

    fn parts(&self) -> impl Iterator<Item = (f64, &Normal)> + Clone {
        self.alive.iter().map(|i| (self.weights[*i], &self.filters[*i]))
    }

    pub(super) fn is_finite(&self) -> bool {
        self.parts().all(|(_, filter)| filter.is_finite()) && self.log_weight.is_finite()
    }
}
