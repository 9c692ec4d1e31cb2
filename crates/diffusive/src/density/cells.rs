//! A density represented by equal cells: the exact belief in few dimensions.

use crate::Error;
use fewbits_core::columns::{change_each, state_at};
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use fewbits_densities::Categorical;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::{all_finite, at_least_one, positive, refuse};
use fewbits_numerics::kernels::exp_minus;
use fewbits_numerics::kernels::{largest, sum};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use std::collections::HashMap;
use std::sync::OnceLock;

/// A density that [`Cells`] can cover.
pub trait CellTarget<const D: usize> {
    /// Writes for every cell, a cube about its centre, the log density at the centre (up to one constant) and a score that
    /// decides which cells are kept. The score is the log of the density averaged over the cell, so that a ridge between the centres
    /// is not missed. For cells that are small against the density, score and log density agree.
    fn evaluate(&self, centres: &Columns<'_, D>, half_width: f64, log_densities: &mut [f64], scores: &mut [f64]);
}

/// Which cells are kept and split, and when the refinement stops.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct CellOptions {
    /// Cells whose score is within this many nats of the best are kept and split.
    pub keep: f64,
    /// The refinement stops if the log evidence changes by less than this, in nats, ...
    pub evidence_tolerance: f64,
    /// ... the cells are narrower than this share of the smallest standard deviation, ...
    pub width: f64,
    /// ... and the determinant of the covariance changes by less than this share.
    pub determinant_tolerance: f64,
    /// Largest number of cells.
    pub max_cells: usize,
}

impl Default for CellOptions {
    fn default() -> Self {
        Self {
            keep: 18.0,
            evidence_tolerance: 5e-3,
            width: 0.8,
            determinant_tolerance: 0.02,
            max_cells: 2_000_000,
        }
    }
}

/// Largest number of splits: the cells are then 2^-48 of the box.
const MAX_DEPTH: usize = 48;
/// Cells below this share of the largest weight are dropped at the end.
const NEGLIGIBLE: f64 = 1e-12;

/// A normalised density over equal cubic cells, of any shape. It is constant on each cell.
///
/// Sums over the centres are the midpoint rule. Its error falls faster than any power of the cell width for a smooth density that the
/// cells resolve: with cells of 0.8 standard deviations the moments are accurate to about 1e-7.
///
/// ```text
/// cover the box with cells
/// repeat: evaluate log density and score at every centre
///         stop if evidence and determinant have settled and cells are narrower than the density
///         keep the cells within 18 nats of the best score; split each in 2^D
/// ```
#[derive(Debug, Clone)]
pub struct Cells<const D: usize> {
    columns: [Vec<f64>; D],
    weights: Vec<f64>,
    log_weights: Vec<f64>,
    width: f64,
    log_evidence: f64,
    evaluations: usize,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
    places: OnceLock<HashMap<[i64; D], usize>>,
}

fn too_many(cells: usize) -> Error {
    Error::Unresolved {
        value: cells as f64,
        unit: "cells needed",
        expected: "at most `max_cells`",
    }
}

impl<const D: usize> Cells<D> {
    /// Covers the box between two corners with `per_axis` cells along its longest side, and refines.
    ///
    /// # Errors
    /// If the box is empty or `per_axis` is zero; [`Error::Impossible`] if the density is zero at every centre or a value is NaN;
    /// [`Error::Unresolved`] if the density needs more cells than allowed.
    pub fn cover(
        target: &impl CellTarget<D>,
        lower: [f64; D],
        upper: [f64; D],
        per_axis: usize,
        options: &CellOptions,
    ) -> Result<Self, Error> {
        at_least_one("per_axis", per_axis)?;
        all_finite("lower", &lower)?;
        all_finite("upper", &upper)?;
        let mut longest: f64 = 0.0;
        for d in 0..D {
            longest = longest.max(positive("upper - lower", upper[d] - lower[d])?);
        }
        let mut width = longest / per_axis as f64;
        let mut centres = lattice(&lower, &upper, width, options.max_cells)?;
        let (mut logs, mut scores, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        let mut before: Option<(f64, f64)> = None;
        let mut evaluations = 0;
        // Each level halves the width of the cells that are kept.
        for _ in 0..MAX_DEPTH {
            let count = centres[0].len();
            logs.clear();
            logs.resize(count, 0.0);
            scores.clear();
            scores.resize(count, 0.0);
            target.evaluate(&centres.each_ref().map(Vec::as_slice), 0.5 * width, &mut logs, &mut scores);
            evaluations += count;
            let (best, best_score) = (largest(&logs), largest(&scores));
            if !best_score.is_finite() || logs.iter().chain(&scores).any(|x| x.is_nan()) {
                return Err(Error::Impossible);
            }
            if best.is_finite() {
                weights.clear();
                weights.resize(count, 0.0);
                exp_minus(&logs, best, &mut weights);
                let total = sum(&weights);
                let log_evidence = best + total.ln() + D as f64 * width.ln();
                let (mean, covariance) = moments(&centres, &weights, total);
                let variances = symmetric_eigen(covariance).0;
                let (determinant, narrowest) = (variances.product(), variances.min().max(0.0).sqrt());
                // Done when evidence and covariance no longer change with the cell width, and cells are small beside the posterior.
                let settled = before.is_some_and(|(evidence, size)| {
                    (log_evidence - evidence).abs() < options.evidence_tolerance
                        && (determinant / size - 1.0).abs() < options.determinant_tolerance
                });
                if settled && width < options.width * narrowest {
                    let keep = |values: &[f64], scale: f64| -> Vec<f64> {
                        let paired = values.iter().zip(&weights);
                        let kept = paired.filter(|(_, w)| **w > NEGLIGIBLE);
                        kept.map(|(v, _)| v * scale).collect()
                    };
                    let columns = centres.each_ref().map(|column| keep(column, 1.0));
                    let weights = keep(&weights, total.recip());
                    return Ok(Self {
                        columns,
                        log_weights: weights.iter().map(|w| w.ln()).collect(),
                        weights,
                        width,
                        log_evidence,
                        evaluations,
                        mean,
                        covariance,
                        places: OnceLock::new(),
                    });
                }
                before = Some((log_evidence, determinant));
            }
            let threshold = best_score - options.keep;
            // Count before allocating: a density that is too thin is refused without using the memory.
            let kept = scores.iter().filter(|score| **score > threshold).count();
            if kept << D > options.max_cells {
                return Err(too_many(kept << D));
            }
            let kept = (0..scores.len()).filter(|i| scores[*i] > threshold);
            centres = split(&centres, kept, 0.25 * width);
            width *= 0.5;
        }
        Err(too_many(centres[0].len()))
    }

    /// Centres of the cells: one column per coordinate.
    pub fn columns(&self) -> Columns<'_, D> {
        self.columns.each_ref().map(Vec::as_slice)
    }

    /// Probabilities of the cells; they sum to one.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of cells.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Side of a cell.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Logarithm of the integral of the target.
    pub fn log_evidence(&self) -> f64 {
        self.log_evidence
    }

    /// Number of density evaluations so far.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// Lower and upper corner of the box that contains all cells.
    pub fn bounds(&self) -> ([f64; D], [f64; D]) {
        let half = 0.5 * self.width;
        let end = |column: &Vec<f64>, f: fn(f64, f64) -> f64| column.iter().copied().reduce(f).unwrap_or(0.0);
        (
            self.columns.each_ref().map(|column| end(column, f64::min) - half),
            self.columns.each_ref().map(|column| end(column, f64::max) + half),
        )
    }

    /// Kullback-Leibler divergence `KL(self || other)` in nats, by the midpoint rule; infinite if `other` is zero on a cell.
    pub fn kl_to(&self, other: &impl Density<D>) -> f64 {
        let mut logs = vec![0.0; self.len()];
        other.add_log_densities(&self.columns(), &mut logs);
        self.kl_to_logs(&logs)
    }

    /// As [`Cells::kl_to`], from the log density of the other at the centre of each cell.
    pub fn kl_to_logs(&self, logs: &[f64]) -> f64 {
        let volume = D as f64 * self.width.ln();
        let terms = self.weights.iter().zip(&self.log_weights).zip(logs);
        terms.map(|((w, own), theirs)| w * (own - volume - theirs)).sum()
    }

    fn place(&self, x: impl Fn(usize) -> f64) -> [i64; D] {
        std::array::from_fn(|d| ((x(d) - self.columns[d][0]) / self.width).round() as i64)
    }
}

impl<const D: usize> Belief<D> for Cells<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean
    }

    /// Covariance by the midpoint rule. For a smooth density it is more accurate than that of the piecewise constant density, which is
    /// larger by `width^2 / 12`.
    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance
    }

    /// Draws are centres of cells: their covariance is then that of [`covariance`](Belief::covariance).
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let weighted = Categorical::new(&self.weights);
        change_each(states, |_| state_at(&self.columns(), weighted.draw(rng)));
    }
}

impl<const D: usize> Density<D> for Cells<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        let places = self.places.get_or_init(|| {
            (0..self.len())
                .map(|i| (self.place(|d| self.columns[d][i]), i))
                .collect()
        });
        match places.get(&self.place(|d| state[d])) {
            Some(i) => self.log_weights[*i] - D as f64 * self.width.ln(),
            None => f64::NEG_INFINITY,
        }
    }
}

/// The centres of cells of the given width that cover a box.
pub(crate) fn lattice<const D: usize>(
    lower: &[f64; D],
    upper: &[f64; D],
    width: f64,
    most: usize,
) -> Result<[Vec<f64>; D], Error> {
    let counts: [usize; D] = std::array::from_fn(|d| (((upper[d] - lower[d]) / width - 1e-9).ceil() as usize).max(1));
    let total = counts
        .iter()
        .try_fold(1_usize, |product, count| product.checked_mul(*count));
    let Some(total) = total.filter(|total| *total <= most) else {
        return refuse("per_axis", format!("{counts:?} cells"), format!("at most {most} cells"));
    };
    let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| Vec::with_capacity(total));
    for i in 0..total {
        let mut rest = i;
        for d in 0..D {
            // The lattice is centred: if the box is no multiple of the width, it protrudes equally on both sides.
            let middle = 0.5 * (lower[d] + upper[d]);
            columns[d].push(middle + width * ((rest % counts[d]) as f64 - 0.5 * (counts[d] - 1) as f64));
            rest /= counts[d];
        }
    }
    Ok(columns)
}

/// The centres of the `2^D` parts of each of the given cells, at `step` from the cell's own centre along each axis.
pub(crate) fn split<const D: usize>(
    centres: &[Vec<f64>; D],
    cells: impl Iterator<Item = usize> + Clone,
    step: f64,
) -> [Vec<f64>; D] {
    std::array::from_fn(|d| {
        let parts = |i: usize| {
            let x = centres[d][i];
            (0..1_usize << D).map(move |part| if part >> d & 1 == 0 { x - step } else { x + step })
        };
        cells.clone().flat_map(parts).collect()
    })
}

fn moments<const D: usize>(
    centres: &[Vec<f64>; D],
    weights: &[f64],
    total: f64,
) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
    let mean = SVector::from_fn(|d, _| fewbits_numerics::kernels::dot(&centres[d], weights) / total);
    let mut covariance = SMatrix::zeros();
    for i in 0..D {
        for j in 0..=i {
            let (a, b) = (&centres[i], &centres[j]);
            let entry = fewbits_numerics::kernels::weighted_covariance(weights, (a, mean[i]), (b, mean[j])) / total;
            covariance[(i, j)] = entry;
            covariance[(j, i)] = entry;
        }
    }
    (mean, covariance)
}
