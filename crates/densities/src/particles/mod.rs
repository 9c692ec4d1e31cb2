//! Weighted particles, stored by columns.

mod gaussian_cloud;
mod stored;
mod systematic;
pub(crate) mod weights;

pub use gaussian_cloud::GaussianCloud;
pub use systematic::{systematic, systematic_into};
pub use weights::Categorical;

use crate::Error;
use fewbits_core::columns::state_at;
use fewbits_core::{Belief, Columns, ColumnsMut};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, at_least_one, entries, probabilities, refuse};
use fewbits_numerics::kernels::{dot, weighted_covariance};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};
use stored::StoredParticles;
use weights::{gather_rows, normalise};

/// A density `sum_i w_i delta(x - x_i)` over `R^D` whose weights sum to one.
///
/// Each coordinate is one contiguous column. The weights are stored both as logarithms and as numbers, so that a filter's
/// inner loops run over plain slices, no weight underflows while it is computed, and one exponential per particle is computed when the
/// weights change. They change only through [`reweigh`](Self::reweigh), which either succeeds or leaves the belief unchanged.
///
/// A particle may also carry a row of auxiliary numbers ([`with_auxiliary`](Self::with_auxiliary)), which is copied with the particle when
/// particles are selected. Examples: a sensor's estimate given the particle's history, a label, a statistic.
///
/// ```
/// use fewbits_core::Belief;
/// use fewbits_densities::Particles;
/// let belief = Particles::new([vec![0.0, 1.0, 4.0]], &[0.0, 0.0, f64::NEG_INFINITY])?;
/// assert_eq!(belief.mean()[0], 0.5);
/// assert_eq!(belief.effective_sample_size(), 2.0);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Serialize, Deserialize)]
#[serde(try_from = "StoredParticles", into = "StoredParticles")]
pub struct Particles<const D: usize> {
    columns: [Vec<f64>; D],
    log_weights: Vec<f64>,
    weights: Vec<f64>,
    effective_sample_size: f64,
    /// One row of `auxiliary.len() / len` numbers per particle, one row after the other.
    auxiliary: Vec<f64>,
    /// Memory for a column or for new weights, so that no step allocates.
    scratch: Vec<f64>,
}

impl<const D: usize> Particles<D> {
    /// Particles from their columns and log weights. The log weights may have any common offset; `-inf` is a weight of zero.
    ///
    /// # Errors
    /// If lengths differ, there is no particle, a coordinate is not finite, a log weight is NaN or `+inf`, or all weights are zero.
    pub fn new(columns: [Vec<f64>; D], log_weights: &[f64]) -> Result<Self, Error> {
        if let Some(bad) = log_weights.iter().find(|w| w.is_nan() || **w == f64::INFINITY) {
            return refuse("log_weights", bad, "log weights below infinity");
        }
        let mut belief = Self::uniform(columns)?;
        if belief.len() != log_weights.len() {
            let given = format!("{} numbers", log_weights.len());
            return refuse("log_weights", given, format!("{}, one per particle", belief.len()));
        }
        belief.reweigh(|_, own| own.copy_from_slice(log_weights))?;
        Ok(belief)
    }

    /// Equally weighted particles from their columns.
    ///
    /// # Errors
    /// If lengths differ, there is no particle, or a coordinate is not finite.
    pub fn uniform(columns: [Vec<f64>; D]) -> Result<Self, Error> {
        let count = columns.first().map_or(0, Vec::len);
        at_least_one("particles", count)?;
        for column in &columns {
            entries("columns", column.len(), count)?;
            all_finite("columns", column)?;
        }
        let mut belief = Self {
            columns,
            log_weights: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            effective_sample_size: 0.0,
            auxiliary: Vec::new(),
            scratch: Vec::with_capacity(count),
        };
        belief.equalise(count);
        Ok(belief)
    }

    /// Equally weighted particles, one per call of `draw`.
    ///
    /// # Errors
    /// If `count` is zero or a draw is not finite.
    pub fn from_draws(count: usize, mut draw: impl FnMut() -> SVector<f64, D>) -> Result<Self, Error> {
        let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| Vec::with_capacity(count));
        for _ in 0..count {
            let point = draw();
            for (column, x) in columns.iter_mut().zip(point.iter()) {
                column.push(*x);
            }
        }
        Self::uniform(columns)
    }

    /// Equally weighted particles, drawn independently from a belief.
    ///
    /// # Errors
    /// If `count` is zero or a draw is not finite.
    pub fn from_belief<R: Rng + ?Sized>(rng: &mut R, belief: &impl Belief<D>, count: usize) -> Result<Self, Error> {
        let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| vec![0.0; count]);
        belief.sample_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
        Self::uniform(columns)
    }

    /// The same particles, each with a row of auxiliary numbers. `auxiliary` holds the rows one after the other.
    ///
    /// # Errors
    /// If the length of `auxiliary` is no multiple of the number of particles, or an entry is not finite.
    pub fn with_auxiliary(mut self, auxiliary: Vec<f64>) -> Result<Self, Error> {
        all_finite("auxiliary", &auxiliary)?;
        if !auxiliary.len().is_multiple_of(self.len()) {
            let expected = format!("rows of equal length for {} particles", self.len());
            return refuse("auxiliary", format!("{} numbers", auxiliary.len()), expected);
        }
        self.auxiliary = auxiliary;
        Ok(self)
    }

    /// Number of auxiliary numbers per particle.
    pub fn auxiliary_width(&self) -> usize {
        self.auxiliary.len() / self.len()
    }

    /// The auxiliary numbers of all particles, one row after the other.
    pub fn auxiliary(&self) -> &[f64] {
        &self.auxiliary
    }

    /// Coordinates and auxiliary rows, to be changed in place. Finite numbers must stay finite.
    pub fn parts_mut(&mut self) -> (ColumnsMut<'_, D>, &mut [f64]) {
        (self.columns.each_mut().map(Vec::as_mut_slice), &mut self.auxiliary)
    }

    /// Number of particles, at least one.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// The coordinates: `columns()[d][i]` is coordinate `d` of particle `i`.
    pub fn columns(&self) -> Columns<'_, D> {
        self.columns.each_ref().map(Vec::as_slice)
    }

    /// The coordinates, to be changed in place (for instance by propagation). Finite numbers must stay finite.
    pub fn columns_mut(&mut self) -> ColumnsMut<'_, D> {
        self.columns.each_mut().map(Vec::as_mut_slice)
    }

    /// Normalised weights.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Logarithms of the normalised weights.
    pub fn log_weights(&self) -> &[f64] {
        &self.log_weights
    }

    /// Particle `i`, or `None` past the end.
    pub fn point(&self, i: usize) -> Option<SVector<f64, D>> {
        (i < self.len()).then(|| state_at(&self.columns, i))
    }

    /// Effective sample size `1 / sum w_i^2`, between 1 and the number of particles.
    pub fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// Calls `change` to edit the log weights (usually to add log likelihoods) and normalises them. Returns
    /// `ln sum_i exp(log weight_i)` after the change. If log likelihoods were added, this estimates the log likelihood of the observation.
    ///
    /// # Errors
    /// [`Error::Impossible`] if all weights are zero, [`Error::NotANumber`] if one is NaN or infinite. The
    /// belief is then unchanged.
    pub fn reweigh(&mut self, change: impl FnOnce(Columns<'_, D>, &mut [f64])) -> Result<f64, Error> {
        self.scratch.clear();
        self.scratch.extend_from_slice(&self.log_weights);
        change(self.columns.each_ref().map(Vec::as_slice), &mut self.scratch);
        // The copy becomes the belief's only after it was normalised, so that a failure changes nothing.
        let (log_sum, effective_sample_size) = normalise(&mut self.scratch, &mut self.weights)?;
        std::mem::swap(&mut self.log_weights, &mut self.scratch);
        self.effective_sample_size = effective_sample_size;
        Ok(log_sum)
    }

    /// Replaces the particles by equally weighted copies of those with the given indices. The new number of particles is the number of
    /// indices.
    ///
    /// # Errors
    /// If there is no index, or one is not below [`len`](Self::len). The belief is then unchanged.
    pub fn select(&mut self, ancestors: &[u32]) -> Result<(), Error> {
        self.check(ancestors)?;
        let width = self.auxiliary_width();
        for column in &mut self.columns {
            self.scratch.clear();
            self.scratch.extend(ancestors.iter().map(|a| column[*a as usize]));
            std::mem::swap(column, &mut self.scratch);
        }
        if width > 0 {
            self.scratch.clear();
            gather_rows(&self.auxiliary, width, ancestors, &mut self.scratch);
            std::mem::swap(&mut self.auxiliary, &mut self.scratch);
        }
        self.equalise(ancestors.len());
        Ok(())
    }

    /// Becomes a selection of the particles of `source`, as by [`select`](Self::select), reusing this belief's memory.
    ///
    /// # Errors
    /// As [`select`](Self::select).
    pub fn select_from(&mut self, source: &Self, ancestors: &[u32]) -> Result<(), Error> {
        source.check(ancestors)?;
        for (column, from) in self.columns.iter_mut().zip(&source.columns) {
            column.clear();
            column.extend(ancestors.iter().map(|a| from[*a as usize]));
        }
        self.auxiliary.clear();
        gather_rows(&source.auxiliary, source.auxiliary_width(), ancestors, &mut self.auxiliary);
        self.equalise(ancestors.len());
        Ok(())
    }

    fn check(&self, ancestors: &[u32]) -> Result<(), Error> {
        at_least_one("ancestors", ancestors.len())?;
        let count = self.len();
        // A maximum runs in vector registers; a search with an early exit does not.
        let largest = ancestors.iter().fold(0, |largest: u32, a| largest.max(*a));
        if largest as usize >= count {
            return refuse("ancestors", largest, format!("indices below {count}"));
        }
        Ok(())
    }

    fn equalise(&mut self, count: usize) {
        let weight = 1.0 / count as f64;
        self.weights.clear();
        self.weights.resize(count, weight);
        self.log_weights.clear();
        self.log_weights.resize(count, weight.ln());
        self.effective_sample_size = count as f64;
    }

    /// Weighted covariance `sum w (x - mean)(x - mean)^T` about a given mean, without a small-sample correction.
    pub fn covariance_about(&self, mean: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let w = self.weights.as_slice();
        let mut covariance = SMatrix::zeros();
        for i in 0..D {
            for j in 0..=i {
                let entry = weighted_covariance(w, (&self.columns[i], mean[i]), (&self.columns[j], mean[j]));
                covariance[(i, j)] = entry;
                covariance[(j, i)] = entry;
            }
        }
        covariance
    }
}

/// `clone_from` reuses memory, so that a filter can keep a previous belief without allocating.
impl<const D: usize> Clone for Particles<D> {
    fn clone(&self) -> Self {
        Self {
            columns: self.columns.clone(),
            log_weights: self.log_weights.clone(),
            weights: self.weights.clone(),
            effective_sample_size: self.effective_sample_size,
            auxiliary: self.auxiliary.clone(),
            scratch: Vec::with_capacity(self.len()),
        }
    }

    fn clone_from(&mut self, other: &Self) {
        self.columns.clone_from(&other.columns);
        self.log_weights.clone_from(&other.log_weights);
        self.weights.clone_from(&other.weights);
        self.effective_sample_size = other.effective_sample_size;
        self.auxiliary.clone_from(&other.auxiliary);
    }
}

/// Two beliefs are equal if columns, weights and auxiliary rows are equal.
impl<const D: usize> PartialEq for Particles<D> {
    fn eq(&self, other: &Self) -> bool {
        self.columns == other.columns && self.log_weights == other.log_weights && self.auxiliary == other.auxiliary
    }
}

impl<const D: usize> Belief<D> for Particles<D> {
    fn mean(&self) -> SVector<f64, D> {
        SVector::from_fn(|d, _| dot(&self.weights, &self.columns[d]))
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance_about(&self.mean())
    }

    /// Each draw is a particle, chosen with probability equal to its weight.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        if !fewbits_core::columns::columns_agree(&mut states) {
            return;
        }
        let cumulative = Categorical::new(&self.weights);
        let count = fewbits_core::columns::count(&states);
        let chosen: Vec<usize> = (0..count).map(|_| cumulative.draw(rng)).collect();
        for (states, column) in states.into_iter().zip(&self.columns) {
            for (x, i) in states.iter_mut().zip(&chosen) {
                *x = column[*i];
            }
        }
    }
}

impl<const D: usize> From<Particles<D>> for StoredParticles {
    fn from(belief: Particles<D>) -> Self {
        // Logarithms of equal weights follow from the weights.
        let equal = belief.log_weights.windows(2).all(|pair| pair[0] == pair[1]);
        Self {
            columns: belief.columns.into(),
            weights: belief.weights,
            log_weights: if equal {
                Vec::new()
            } else {
                belief.log_weights.into_iter().map(Some).collect()
            },
            effective_sample_size: (!equal).then_some(belief.effective_sample_size),
            auxiliary: belief.auxiliary,
        }
    }
}

impl<const D: usize> TryFrom<StoredParticles> for Particles<D> {
    type Error = Error;

    fn try_from(stored: StoredParticles) -> Result<Self, Error> {
        let weights = stored.weights;
        probabilities("weights", &weights)?;
        let log_weights: Vec<f64> = if stored.log_weights.is_empty() {
            weights.iter().map(|w| w.ln()).collect()
        } else {
            let logs = stored.log_weights.iter();
            logs.map(|log| log.unwrap_or(f64::NEG_INFINITY)).collect()
        };
        let agree = |(log, w): (&f64, &f64)| (log.exp() - w).abs() <= 1e-9;
        if log_weights.len() != weights.len() || !log_weights.iter().zip(&weights).all(agree) {
            let text = format!("{} numbers", log_weights.len());
            return refuse("log_weights", text, "the logarithms of the weights");
        }
        let effective = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let given = stored.effective_sample_size;
        if let Some(bad) = given.filter(|n| (n / effective - 1.0).abs() > 1e-9 || n.is_nan()) {
            return refuse("effective_sample_size", bad, format!("{effective}"));
        }
        let columns = stored.columns.try_into().map_err(|columns: Vec<Vec<f64>>| {
            ArgumentError::new("columns", format!("{} columns", columns.len()), format!("{D} columns"))
        })?;
        let mut belief = Self::new(columns, &log_weights)?.with_auxiliary(stored.auxiliary)?;
        // The effective sample size is kept as it was stored, to the last bit.
        if weights.windows(2).all(|pair| pair[0] == pair[1]) {
            belief.equalise(weights.len());
        } else {
            belief.effective_sample_size = given.unwrap_or(belief.effective_sample_size);
            (belief.weights, belief.log_weights) = (weights, log_weights);
        }
        Ok(belief)
    }
}
