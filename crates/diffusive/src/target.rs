//! The product of a belief and the likelihood of records, evaluated on cells.

use crate::belief::{Prior, SentBelief};
use crate::density::{CellTarget, Cells};
use crate::likelihood::SourceLikelihood;
use crate::rate::{Intervals, RateModel, RateRange, RateSums, cut_normal, ends_about};
use fewbits_core::{Columns, Error};
use fewbits_numerics::{LogSum, kernels::largest, normal::log_interval};
use nalgebra::{Matrix2, Vector2};

/// A Gaussian over the plane, prepared for averages over cells of any width.
#[derive(Debug, Clone, Copy)]
struct Lobe {
    log_scale: f64,
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// Inverse covariance, as (xx, xy, yy).
    precision: [f64; 3],
}

impl Lobe {
    fn new(weight: f64, mean: Vector2<f64>, covariance: Matrix2<f64>) -> Self {
        Self {
            log_scale: weight.ln() - 0.5 * covariance.determinant().ln() - std::f64::consts::TAU.ln(),
            mean,
            covariance,
            precision: precision(&covariance, 0.0),
        }
    }

    /// Log density at `offset` from the mean, with its own precision or that of raised variances.
    #[inline]
    fn log_at(&self, precision: &[f64; 3], offset: &Vector2<f64>) -> f64 {
        self.log_scale - 0.5 * quadratic(precision, offset)
    }
}

/// Inverse of a covariance with `extra` on the diagonal, as (xx, xy, yy).
fn precision(c: &Matrix2<f64>, extra: f64) -> [f64; 3] {
    let (a, b, d) = (c[(0, 0)] + extra, c[(0, 1)], c[(1, 1)] + extra);
    let determinant = a * d - b * b;
    [d / determinant, -b / determinant, a / determinant]
}

#[inline]
fn quadratic(p: &[f64; 3], d: &Vector2<f64>) -> f64 {
    p[0] * d.x * d.x + 2.0 * p[1] * d.x * d.y + p[2] * d.y * d.y
}

/// The rate given the position, in one Gaussian of a belief over both.
#[derive(Debug, Clone, Copy)]
struct Conditional {
    mean: f64,
    gain: Vector2<f64>,
    variance: f64,
}

pub(crate) struct Target<'a> {
    prior: &'a Prior,
    likelihood: &'a SourceLikelihood,
    lobes: Vec<Lobe>,
    conditionals: Vec<Conditional>,
}

/// Means and variances of the rate, one of each per cell.
type RateMoments = (Vec<f64>, Vec<f64>);

impl<'a> Target<'a> {
    pub(crate) fn new(prior: &'a Prior, likelihood: &'a SourceLikelihood) -> Result<Self, Error> {
        let (mut lobes, mut conditionals) = (Vec::new(), Vec::new());
        match prior {
            Prior::Exact(gaussian) => lobes.push(Lobe::new(1.0, *gaussian.mean(), *gaussian.covariance())),
            Prior::Position(SentBelief::Mixture(mixture)) => {
                lobes.extend(
                    mixture
                        .components()
                        .iter()
                        .map(|c| Lobe::new(c.weight(), *c.mean(), *c.covariance())),
                );
            }
            Prior::Position(SentBelief::Other(_)) | Prior::WithRate(SentBelief::Other(_), _) => {}
            Prior::WithRate(SentBelief::Mixture(mixture), _) => {
                for c in mixture.components() {
                    let s = c.covariance();
                    let position = s.fixed_view::<2, 2>(0, 0).into_owned();
                    let cross = Vector2::new(s[(2, 0)], s[(2, 1)]);
                    let lobe = Lobe::new(c.weight(), Vector2::new(c.mean()[0], c.mean()[1]), position);
                    let p = lobe.precision;
                    let gain = Vector2::new(p[0] * cross.x + p[1] * cross.y, p[1] * cross.x + p[2] * cross.y);
                    // The Schur complement is positive; rounding may make it zero or negative.
                    let variance = (s[(2, 2)] - gain.dot(&cross)).max(1e-14 * s[(2, 2)]);
                    lobes.push(lobe);
                    conditionals.push(Conditional {
                        mean: c.mean()[2],
                        gain,
                        variance,
                    });
                }
            }
        }
        Ok(Self {
            prior,
            likelihood,
            lobes,
            conditionals,
        })
    }

    /// Expected squared distance of the position from the nearest Gaussian of a received mixture, in its standard deviations, and the
    /// number of coordinates. It measures how far these samples move the belief. Zero for other priors.
    ///
    /// If belief and model are right, the position is a draw of the mixture. Its squared distance from its own Gaussian is then
    /// chi-squared with two degrees of freedom, and the nearest Gaussian is at most as far.
    pub(crate) fn conflict(&self, cells: &Cells<2>) -> (f64, usize) {
        if matches!(self.prior, Prior::Exact(_)) || self.lobes.is_empty() {
            return (0.0, 0);
        }
        let [x, y] = cells.columns();
        let at = |i: usize| {
            let distance = |lobe: &Lobe| quadratic(&lobe.precision, &(Vector2::new(x[i], y[i]) - lobe.mean));
            self.lobes.iter().map(distance).fold(f64::INFINITY, f64::min)
        };
        let sum = cells
            .weights()
            .iter()
            .enumerate()
            .map(|(i, weight)| weight * at(i))
            .sum();
        (sum, 2)
    }

    /// Mean and variance of the rate in every cell, if it is unknown and shared, and the expected sum of squared residuals over
    /// the noise variance.
    pub(crate) fn rates_and_fit(&self, cells: &Cells<2>) -> (Option<RateMoments>, f64) {
        let [x, y] = cells.columns();
        let (mut means, mut variances, mut chi_squared) = (Vec::new(), Vec::new(), 0.0);
        for ((x, y), weight) in x.iter().zip(y).zip(cells.weights()) {
            let at = Vector2::new(*x, *y);
            let sums = self.likelihood.sums(&at);
            let rate = match (self.prior, self.likelihood.rate()) {
                (Prior::WithRate(SentBelief::Other(density), range), _) => {
                    let sums = [sums.response, sums.correlation, sums.energy];
                    let moments = density.rate(&at, 0.0, sums, [range.low(), range.high()]);
                    (moments.mean, moments.variance)
                }
                (Prior::WithRate(_, range), _) => self.rate_of_mixture(&at, &sums, range),
                (Prior::Exact(_), RateModel::Joint(range)) => sums.rate_given_position(range),
                _ => {
                    chi_squared += weight * self.likelihood.chi_squared(&at);
                    continue;
                }
            };
            means.push(rate.0);
            variances.push(rate.1);
            chi_squared += weight * sums.chi_squared(rate);
        }
        ((!means.is_empty()).then_some((means, variances)), chi_squared)
    }

    fn rate_of_mixture(&self, at: &Vector2<f64>, sums: &RateSums, range: &RateRange) -> (f64, f64) {
        let (mut total, mut first, mut second, mut best) = (0.0, 0.0, 0.0, f64::NEG_INFINITY);
        let middle = range.middle();
        for (lobe, given) in self.lobes.iter().zip(&self.conditionals) {
            let d = at - lobe.mean;
            let log = lobe.log_at(&lobe.precision, &d);
            let (evidence, mean, variance) = updated(given, &d, [sums.response, sums.correlation, sums.energy]);
            // The evidence is at most zero, and truncation only lowers it: this lobe cannot matter.
            if log + evidence < best - FAINT {
                continue;
            }
            let inside = ends_about(mean, variance, range).map_or(0.0, |(from, to)| log_interval(from, to));
            let log = log + evidence + inside;
            if log < best - FAINT || !log.is_finite() {
                continue;
            }
            // Sums are relative to the largest term so far, so that they do not underflow.
            if log > best {
                let shrink = (best - log).exp();
                total *= shrink;
                first *= shrink;
                second *= shrink;
                best = log;
            }
            let weight = (log - best).exp();
            let (m, v) = cut_normal(mean, variance, range);
            let m = m - middle;
            total += weight;
            first += weight * m;
            second += weight * (v + m * m);
        }
        let mean = first / total;
        if total > 0.0 {
            (mean + middle, (second / total - mean * mean).max(0.0))
        } else {
            (middle, 0.0)
        }
    }
}

/// Log evidence of the sums `[A, B, C]` under a Gaussian rate, and the updated mean and variance. The constants of truncation and noise
/// and the effect of truncation are left out.
#[inline]
fn updated(given: &Conditional, d: &Vector2<f64>, [a, b, c]: [f64; 3]) -> (f64, f64, f64) {
    let (m, v) = (given.mean + given.gain.dot(d), given.variance);
    // A Kalman update of the rate by all samples together: they have information A about it.
    let spread = 1.0 + v * a;
    let residual = b - a * m;
    let variance = v / spread;
    let mean = m + residual * variance;
    let log = -0.5 * (c - m * (2.0 * b - m * a)) + 0.5 * residual * residual * variance - 0.5 * spread.ln();
    (log, mean, variance)
}

/// Number of cells that are processed together: their numbers fit into the fastest caches.
const RUN: usize = 1024;

impl CellTarget<2> for Target<'_> {
    fn evaluate(&self, centres: &Columns<'_, 2>, half_width: f64, logs: &mut [f64], scores: &mut [f64]) {
        let extra = half_width * half_width;
        let precisions: Vec<[[f64; 3]; 2]> = self
            .lobes
            .iter()
            .map(|l| [l.precision, precision(&l.covariance, extra)])
            .collect();
        // Cells that score far below the best so far will be dropped: their exact log density is not needed.
        let mut floor = f64::NEG_INFINITY;
        let mut scratch = Vec::new();
        let walls = self.likelihood.has_walls();
        let mut room = [vec![0.0; RUN], vec![0.0; RUN]];
        for (run, (logs, scores)) in logs.chunks_mut(RUN).zip(scores.chunks_mut(RUN)).enumerate() {
            let count = logs.len();
            let centres: [&[f64]; 2] = centres.map(|c| &c[run * RUN..run * RUN + count]);
            let at = |i: usize| Vector2::new(centres[0][i], centres[1][i]);
            if let Prior::WithRate(belief, range) = self.prior {
                let out = [&mut *logs, &mut *scores];
                self.with_rate((belief, range), &centres, half_width, &precisions, floor, out);
            } else {
                let [own, wide] = &mut room;
                let (own, wide) = (&mut own[..count], &mut wide[..count]);
                for i in 0..count {
                    (own[i], wide[i]) = match self.prior {
                        Prior::Position(SentBelief::Other(density)) => {
                            density.log_density_and_bound(&at(i), half_width, &mut scratch)
                        }
                        _ => log_mixture(&self.lobes, &precisions, &at(i)),
                    };
                }
                let limits = (floor, DROPPED);
                self.likelihood
                    .blurred(&centres, half_width, wide, limits, [&mut *logs, &mut *scores]);
                logs.iter_mut().zip(own.iter()).for_each(|(log, own)| *log += own);
                scores
                    .iter_mut()
                    .zip(wide.iter())
                    .for_each(|(score, wide)| *score += wide);
            }
            if walls {
                self.exclude_walls(&centres, half_width, logs, scores);
            }
            floor = floor.max(largest(scores) - DROPPED);
        }
    }
}

/// Cells this many nats below the best are dropped by every cover; their mass is negligible.
const DROPPED: f64 = 26.0;
/// Lobes this many nats below another are negligible.
const FAINT: f64 = 30.0;

impl Target<'_> {
    /// Sets cells in which no source can be, and centres at which none can be, to probability zero.
    fn exclude_walls(&self, centres: &[&[f64]; 2], half: f64, logs: &mut [f64], scores: &mut [f64]) {
        for (i, (log, score)) in logs.iter_mut().zip(scores).enumerate() {
            let at = Vector2::new(centres[0][i], centres[1][i]);
            if !self.likelihood.admits(&at, 0.0) {
                *log = f64::NEG_INFINITY;
                if !self.likelihood.admits(&at, half) {
                    *score = f64::NEG_INFINITY;
                }
            }
        }
    }

    /// Log density and score of a run of cells under a belief over position and rate.
    fn with_rate(
        &self,
        (belief, range): (&SentBelief<3>, &RateRange),
        centres: &[&[f64]; 2],
        half: f64,
        precisions: &[[[f64; 3]; 2]],
        floor: f64,
        [logs, scores]: [&mut [f64]; 2],
    ) {
        let count = logs.len();
        let (mut plain, mut blurred) = (vec![[0.0; 3]; count], vec![[0.0; 3]; count]);
        let at = |i: usize| Vector2::new(centres[0][i], centres[1][i]);
        let log_noise: f64 = self.likelihood.records().iter().map(|r| r.sums(&at(0)).log_noise).sum();
        let rate = self.likelihood.rate().largest();
        for record in self.likelihood.records() {
            for i in 0..count {
                let (sums, share) = record.blurred_sums(&at(i), half, rate);
                for (k, value) in [sums.response, sums.correlation, sums.energy].into_iter().enumerate() {
                    plain[i][k] += value;
                    blurred[i][k] += share * value;
                }
            }
        }
        let all: Vec<usize> = (0..count).collect();
        let evaluate = |cells: &[usize], which: usize, sums: &[[f64; 3]], out: &mut [f64]| match belief {
            SentBelief::Mixture(_) => self.log_sums(cells, &at, precisions, (which, sums), range, out),
            SentBelief::Other(density) => {
                let (half, range) = (if which == 1 { half } else { 0.0 }, [range.low(), range.high()]);
                for i in cells {
                    out[*i] = density.rate(&at(*i), half, sums[*i], range).log_mass;
                }
            }
        };
        // Scores with likelihoods widened to the size of a cell decide which cells are worth the exact value.
        evaluate(&all, 1, &blurred, scores);
        let floor = floor.max(largest(scores) - log_noise - DROPPED);
        scores.iter_mut().for_each(|score| *score -= log_noise);
        logs.copy_from_slice(scores);
        let kept: Vec<usize> = all.into_iter().filter(|i| scores[*i] > floor).collect();
        evaluate(&kept, 0, &plain, logs);
        kept.iter().for_each(|i| logs[*i] -= log_noise);
    }

    /// Writes `ln sum over lobes` of the chosen cells to `out`. For every cell the nearest lobe is evaluated first, then those that are not
    /// negligible beside it. Truncation terms of the rate are evaluated together.
    fn log_sums(
        &self,
        cells: &[usize],
        at: &impl Fn(usize) -> Vector2<f64>,
        precisions: &[[[f64; 3]; 2]],
        (which, sums): (usize, &[[f64; 3]]),
        range: &RateRange,
        out: &mut [f64],
    ) {
        let mut intervals = Intervals::default();
        let own = |k: usize, d: &Vector2<f64>| self.lobes[k].log_at(&precisions[k][which], d);
        let term = |k: usize, d: &Vector2<f64>, cell: usize, place: usize, intervals: &mut Intervals| {
            let (log, mean, variance) = updated(&self.conditionals[k], d, sums[cell]);
            intervals.push(place, ends_about(mean, variance, range));
            own(k, d) + log
        };
        let mut nearest = Vec::with_capacity(cells.len());
        let mut first = Vec::with_capacity(cells.len());
        for (place, cell) in cells.iter().enumerate() {
            let x = at(*cell);
            let heights = (0..self.lobes.len()).map(|k| (k, own(k, &(x - self.lobes[k].mean))));
            let (best, _) =
                heights.fold((0, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best });
            nearest.push(best);
            first.push(term(best, &(x - self.lobes[best].mean), *cell, place, &mut intervals));
        }
        intervals.add_to(&mut first);
        // The evidence is at most zero: lobes that are then negligible are not evaluated.
        let (mut others, mut terms) = (Vec::new(), Vec::new());
        for (place, cell) in cells.iter().enumerate() {
            let x = at(*cell);
            for k in 0..self.lobes.len() {
                let d = x - self.lobes[k].mean;
                if k != nearest[place] && own(k, &d) > first[place] - FAINT {
                    others.push(place);
                    terms.push(term(k, &d, *cell, terms.len(), &mut intervals));
                }
            }
        }
        intervals.add_to(&mut terms);
        let mut results = vec![LogSum::default(); cells.len()];
        results
            .iter_mut()
            .zip(&first)
            .for_each(|(result, log)| result.add(*log));
        others
            .iter()
            .zip(&terms)
            .for_each(|(place, log)| results[*place].add(*log));
        for (cell, result) in cells.iter().zip(&results) {
            out[*cell] = result.value();
        }
    }
}

/// Log density of a mixture, and that of its average over the cell.
#[inline]
fn log_mixture(lobes: &[Lobe], precisions: &[[[f64; 3]; 2]], at: &Vector2<f64>) -> (f64, f64) {
    let mut results = [LogSum::default(), LogSum::default()];
    for (lobe, precision) in lobes.iter().zip(precisions) {
        let d = at - lobe.mean;
        for (result, p) in results.iter_mut().zip(precision) {
            result.add(lobe.log_at(p, &d));
        }
    }
    (results[0].value(), results[1].value())
}
