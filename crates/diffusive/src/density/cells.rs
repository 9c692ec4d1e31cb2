//! Equal cells that cover where a density is: the exact belief in few dimensions.

use super::Error;
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::{all_finite, at_least_one, positive};
use fewbits_numerics::kernels::exp_minus;
use fewbits_numerics::kernels::{largest, sum};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use std::collections::HashMap;
use std::sync::OnceLock;

/// A density to be covered by cells.
pub trait CellTarget<const D: usize> {
    /// Writes for every cell, a cube about its centre, the log density at the centre (up to one constant) and a score that
    /// decides which cells are kept: the log density blurred over the cell, so that a ridge that runs between the centres still
    /// scores. Where cells are small against the density, score and log density agree.
    fn evaluate(&self, centres: &Columns<'_, D>, half_width: f64, log_densities: &mut [f64], scores: &mut [f64]);
}

/// When cells are kept, split and small enough.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct CellOptions {
    /// Cells whose score is within this many nats of the best are kept and split.
    pub keep: f64,
    /// The log evidence must settle to this, in nats.
    pub evidence_tolerance: f64,
    /// The cells must be narrower than this share of the smallest standard deviation.
    pub width: f64,
    /// The determinant of the covariance must settle to this share.
    pub determinant_tolerance: f64,
    /// More cells than this are refused.
    pub most_cells: usize,
}

impl Default for CellOptions {
    fn default() -> Self {
        Self {
            keep: 18.0,
            evidence_tolerance: 5e-3,
            width: 0.8,
            determinant_tolerance: 0.02,
            most_cells: 2_000_000,
        }
    }
}

/// Levels of splitting after which a density is taken for a point: cells are then 2^-48 of the box.
const DEEPEST: usize = 48;
/// Cells below this share of the largest weight are dropped at the end.
const NEGLIGIBLE: f64 = 1e-12;

/// A belief over equal cubic cells, of any shape; normalised. The density is constant on each cell.
///
/// Sums over the centres are the midpoint rule, which is spectrally accurate for a smooth density that the cells resolve: moments
/// are good to about 1e-7 with cells of 0.8 standard deviations.
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

impl<const D: usize> Cells<D> {
    /// Covers the box between two corners with `per_axis` cells along its longest side, and refines.
    ///
    /// # Errors
    /// If the box is empty or `per_axis` is zero; [`fewbits_core::Error::Impossible`] if the density is zero at every centre or a value is NaN;
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
        let mut centres = lattice(&lower, &upper, width, options.most_cells)?;
        let (mut logs, mut scores, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        let mut before: Option<(f64, f64)> = None;
        let mut evaluations = 0;
        for _ in 0..DEEPEST {
            let count = centres[0].len();
            logs.clear();
            logs.resize(count, 0.0);
            scores.clear();
            scores.resize(count, 0.0);
            target.evaluate(&centres.each_ref().map(Vec::as_slice), 0.5 * width, &mut logs, &mut scores);
            evaluations += count;
            let (best, best_score) = (largest(&logs), largest(&scores));
            if !best_score.is_finite() || logs.iter().chain(&scores).any(|x| x.is_nan()) {
                return Err(fewbits_core::Error::Impossible.into());
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
                let settled = before.is_some_and(|(evidence, size)| {
                    (log_evidence - evidence).abs() < options.evidence_tolerance
                        && (determinant / size - 1.0).abs() < options.determinant_tolerance
                });
                if settled && width < options.width * narrowest {
                    return Ok(Self::finished(
                        centres,
                        weights,
                        total,
                        (width, log_evidence, evaluations),
                        (mean, covariance),
                    ));
                }
                before = Some((log_evidence, determinant));
            }
            let threshold = best_score - options.keep;
            let kept = scores.iter().filter(|score| **score > threshold).count();
            if kept << D > options.most_cells {
                return Err(Error::Unresolved { cells: kept << D });
            }
            centres = split(&centres, &scores, threshold, 0.25 * width, kept);
            width *= 0.5;
        }
        Err(Error::Unresolved {
            cells: centres[0].len(),
        })
    }

    fn finished(
        centres: [Vec<f64>; D],
        weights: Vec<f64>,
        total: f64,
        (width, log_evidence, evaluations): (f64, f64, usize),
        (mean, covariance): (SVector<f64, D>, SMatrix<f64, D, D>),
    ) -> Self {
        let keep = |values: &[f64], scale: f64| -> Vec<f64> {
            let paired = values.iter().zip(&weights);
            paired
                .filter(|(_, w)| **w > NEGLIGIBLE)
                .map(|(v, _)| v * scale)
                .collect()
        };
        let columns = centres.each_ref().map(|column| keep(column, 1.0));
        let weights = keep(&weights, total.recip());
        Self {
            columns,
            log_weights: weights.iter().map(|w| w.ln()).collect(),
            weights,
            width,
            log_evidence,
            evaluations,
            mean,
            covariance,
            places: OnceLock::new(),
        }
    }

    /// Centres, one column a coordinate.
    pub fn columns(&self) -> Columns<'_, D> {
        self.columns.each_ref().map(Vec::as_slice)
    }

    /// Probabilities of the cells.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Never true: at least one cell holds mass.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Side of a cell.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Logarithm of the integral of the target.
    pub fn log_evidence(&self) -> f64 {
        self.log_evidence
    }

    /// How many densities the cover has cost.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// The box that the cells fill, as its corners.
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
        let volume = D as f64 * self.width.ln();
        let terms = self.weights.iter().zip(&self.log_weights).zip(&logs);
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

    /// Covariance of the midpoint rule: for a smooth density closer to the truth, by `width^2 / 12`, than that of the piecewise
    /// constant density.
    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance
    }

    /// Draws are centres of cells, for the same reason.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let count = states.first().map_or(0, |column| column.len());
        let mut cumulative = Vec::with_capacity(self.len());
        let mut total = 0.0;
        for weight in &self.weights {
            total += weight;
            cumulative.push(total);
        }
        for i in 0..count {
            let level = rng.random::<f64>() * total;
            let chosen = cumulative.partition_point(|c| *c <= level).min(self.len() - 1);
            for d in 0..D {
                states[d][i] = self.columns[d][chosen];
            }
        }
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

fn lattice<const D: usize>(
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
        return Err(ArgumentError::new("per_axis", format!("{counts:?} cells"), format!("at most {most} cells")).into());
    };
    let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| Vec::with_capacity(total));
    for i in 0..total {
        let mut rest = i;
        for d in 0..D {
            // Centred, so that a box that is no multiple of the width is covered evenly.
            let middle = 0.5 * (lower[d] + upper[d]);
            columns[d].push(middle + width * ((rest % counts[d]) as f64 - 0.5 * (counts[d] - 1) as f64));
            rest /= counts[d];
        }
    }
    Ok(columns)
}

fn split<const D: usize>(
    centres: &[Vec<f64>; D],
    scores: &[f64],
    threshold: f64,
    step: f64,
    kept: usize,
) -> [Vec<f64>; D] {
    std::array::from_fn(|d| {
        let mut column = Vec::with_capacity(kept << D);
        for (x, score) in centres[d].iter().zip(scores) {
            if *score > threshold {
                column.extend((0..1_usize << D).map(|child| if child >> d & 1 == 0 { x - step } else { x + step }));
            }
        }
        column
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// A thin ring: radius 20, half a centimetre wide.
    struct Ring;

    impl CellTarget<2> for Ring {
        fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
            for i in 0..logs.len() {
                let off = Vector2::new(centres[0][i], centres[1][i]).norm() - 20.0;
                logs[i] = -0.5 * off * off / (0.05 * 0.05);
                scores[i] = -0.5 * off * off / (0.05 * 0.05 + half * half);
            }
        }
    }

    #[test]
    fn a_thin_ring_is_found_whole() {
        let cells = Cells::cover(&Ring, [-50.0; 2], [60.0; 2], 40, &CellOptions::default()).unwrap();
        // The integral of the Gaussian profile times the circumference.
        let exact = (std::f64::consts::TAU * 20.0 * (std::f64::consts::TAU).sqrt() * 0.05).ln();
        assert!((cells.log_evidence() - exact).abs() < 1e-3, "{} {exact}", cells.log_evidence());
        // The stop rule promises the determinant to 2 per cent and no more.
        assert!(cells.mean().norm() < 0.1 && (cells.covariance()[(0, 0)] / 200.0 - 1.0).abs() < 1e-2);
        // Every cell has its own density, at its centre and off it.
        for (i, off) in [(0, 0.0), (cells.len() / 2, 0.4), (cells.len() - 1, -0.4)] {
            let centre = Vector2::new(cells.columns()[0][i], cells.columns()[1][i]);
            let density = cells.weights()[i].ln() - 2.0 * cells.width().ln();
            let found = cells.log_density(&centre.add_scalar(off * cells.width()));
            assert!((found - density).abs() < 1e-9 * density.abs().max(1.0), "{found} {density}");
        }
        assert_eq!(cells.log_density(&Vector2::zeros()), f64::NEG_INFINITY);
        // With cells that resolve the profile the midpoint rule is exact: E r^2 = 20^2 + 3 sd^2.
        let fine = CellOptions {
            evidence_tolerance: 1e-9,
            determinant_tolerance: 1e-7,
            ..CellOptions::default()
        };
        let cells = Cells::cover(&Ring, [-50.0; 2], [60.0; 2], 40, &fine).unwrap();
        assert!((cells.log_evidence() - exact).abs() < 1e-7, "{} {exact}", cells.log_evidence());
        let variance = 0.5 * (400.0 + 3.0 * 0.05 * 0.05);
        assert!(cells.mean().norm() < 1e-5 && (cells.covariance()[(0, 0)] / variance - 1.0).abs() < 1e-6);
    }

    /// A correlated normal in the plane that notes where it was first asked, scores as it is.
    struct Normal {
        first: std::cell::RefCell<Option<[Vec<f64>; 2]>>,
        halves: std::cell::RefCell<Vec<(usize, f64)>>,
    }

    impl CellTarget<2> for Normal {
        fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
            self.first
                .borrow_mut()
                .get_or_insert_with(|| centres.map(<[f64]>::to_vec));
            self.halves.borrow_mut().push((logs.len(), half));
            logs.fill(0.7);
            normal().add_log_densities(centres, logs);
            scores.copy_from_slice(logs);
        }
    }

    fn normal() -> fewbits_densities::Mixture<2> {
        let covariance = nalgebra::Matrix2::new(0.9, 0.3, 0.3, 0.4);
        fewbits_densities::Mixture::new(vec![
            fewbits_densities::Component::new(1.0, Vector2::new(0.4, -0.3), covariance).unwrap(),
        ])
        .unwrap()
    }

    #[test]
    fn cells_of_a_normal_have_its_moments_and_divergences() {
        let target = Normal {
            first: None.into(),
            halves: Vec::new().into(),
        };
        // Boxes of 13 by 8.1 at 20 cells a side of 13: 13 cells of 0.65 cover 8.1 evenly.
        let (lower, upper) = ([-6.0, -4.5], [7.0, 3.6]);
        let options = CellOptions {
            keep: 40.0,
            ..CellOptions::default()
        };
        let cells = Cells::cover(&target, lower, upper, 20, &options).unwrap();
        let [x, y] = target.first.take().unwrap();
        assert_eq!(x.len(), 20 * 13);
        for (i, (x, y)) in x.iter().zip(&y).enumerate() {
            let (a, b) = ((i % 20) as f64, (i / 20) as f64);
            assert!((x - (-6.0 + 0.65 * (a + 0.5))).abs() < 1e-12 && (y - (-0.45 + 0.65 * (b - 6.0))).abs() < 1e-12);
        }
        let asked = target.halves.take();
        assert!(
            asked
                .iter()
                .enumerate()
                .all(|(k, (_, half))| *half == 0.325 / 2.0_f64.powi(k as i32))
        );
        assert_eq!(cells.evaluations(), asked.iter().map(|(n, _)| n).sum::<usize>());
        // It has settled once the cells were halved, narrower than 0.8 of the least deviation, 0.51.
        assert_eq!((asked.len(), cells.width()), (2, 0.325));
        assert!((cells.log_evidence() - 0.7).abs() < 1e-9 && !cells.is_empty());
        assert!((cells.mean() - normal().mean()).amax() < 1e-9);
        assert!((cells.covariance() - normal().covariance()).amax() < 1e-8);
        assert!((cells.weights().iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let (low, high) = cells.bounds();
        for d in 0..2 {
            let column = cells.columns()[d];
            assert!(column.iter().all(|x| x - 0.162 > low[d] && x + 0.162 < high[d]));
            assert!(column.iter().any(|x| x - 0.163 < low[d]) && column.iter().any(|x| x + 0.163 > high[d]));
        }
        // KL between normals: (tr(Q^-1 P) - 2 + d' Q^-1 d + ln det Q - ln det P)/2.
        let other = nalgebra::Matrix2::new(1.4, -0.2, -0.2, 0.8);
        let q = fewbits_densities::Mixture::new(vec![
            fewbits_densities::Component::new(1.0, Vector2::new(0.1, 0.2), other).unwrap(),
        ])
        .unwrap();
        let (precision, d) = (other.try_inverse().unwrap(), Vector2::new(0.3, -0.5));
        let log = (other.determinant() / normal().covariance().determinant()).ln();
        let exact = 0.5 * ((precision * normal().covariance()).trace() - 2.0 + d.dot(&(precision * d)) + log);
        assert!((cells.kl_to(&q) - exact).abs() < 1e-8, "{} {exact}", cells.kl_to(&q));
        assert!(cells.kl_to(&normal()).abs() < 1e-9);
        // Draws are centres, as often as their weights say.
        let mut rng = fewbits_monte_carlo::Stream::new(3).rng();
        let drawn = fewbits_densities::Particles::from_belief(&mut rng, &cells, 20_000).unwrap();
        assert!((drawn.mean() - cells.mean()).amax() < 0.03 && (drawn.covariance() - cells.covariance()).amax() < 0.04);
        assert!(drawn.columns()[0].iter().all(|x| cells.columns()[0].contains(x)));
        // Settled long before the cells are as narrow as they must be: 0.3 of 0.51.
        let narrow = CellOptions { width: 0.3, ..options };
        assert_eq!(Cells::cover(&target, lower, upper, 20, &narrow).unwrap().width(), 0.081_25);
        // Too few cells allowed at the start, and after the first splitting.
        for most in [200, 600] {
            let few = CellOptions {
                most_cells: most,
                ..options
            };
            let error = Cells::cover(&target, lower, upper, 20, &few).unwrap_err();
            assert!(
                most == 200 || matches!(error, Error::Unresolved { cells } if cells > 600 && cells % 4 == 0),
                "{error}"
            );
        }
    }

    struct Nowhere;

    impl CellTarget<2> for Nowhere {
        fn evaluate(&self, _: &Columns<'_, 2>, _: f64, logs: &mut [f64], scores: &mut [f64]) {
            logs.fill(f64::NEG_INFINITY);
            scores.fill(f64::NEG_INFINITY);
        }
    }

    #[test]
    fn misses_are_errors() {
        let cover = |lower, upper, n| Cells::cover(&Nowhere, lower, upper, n, &CellOptions::default());
        assert!(matches!(cover([0.0; 2], [1.0; 2], 8), Err(Error::Core(fewbits_core::Error::Impossible))));
        assert!(cover([0.0; 2], [0.0; 2], 8).is_err() && cover([0.0; 2], [1.0; 2], 0).is_err());
        assert!(cover([0.0; 2], [1.0; 2], 1 << 20).is_err());
    }
}
