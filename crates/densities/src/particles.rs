//! Weighted particles in structure-of-arrays form.

use crate::Error;
use fewbits_core::{Columns, ColumnsMut};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, at_least_one};
use fewbits_numerics::kernels::{dot, exp_minus, largest, weighted_covariance};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// A belief `sum_i w_i delta(x - x_i)` over `R^D`, always normalised.
///
/// Each coordinate is one contiguous column and the weights are kept as logarithms and as themselves, so that a filter's
/// inner loops run over plain slices, no weight underflows on the way, and one exponential a particle is paid where the
/// weights change. They change only through [`reweigh`](Self::reweigh), which either succeeds or leaves the belief as it was.
///
/// ```
/// use fewbits_densities::Particles;
/// let belief = Particles::new([vec![0.0, 1.0, 4.0]], &[0.0, 0.0, f64::NEG_INFINITY])?;
/// assert_eq!(belief.mean()[0], 0.5);
/// assert_eq!(belief.effective_sample_size(), 2.0);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Particles<const D: usize> {
    columns: [Vec<f64>; D],
    log_weights: Vec<f64>,
    weights: Vec<f64>,
    effective_sample_size: f64,
    /// Room for a column or for weights under construction, so that no step allocates.
    scratch: Vec<f64>,
}

impl<const D: usize> Particles<D> {
    /// Particles from their columns and log weights, which may share any offset; `-inf` is a weight of zero.
    ///
    /// # Errors
    /// Lengths that differ, no particle, a coordinate that is not finite, a log weight that is NaN or `+inf`, or all weights
    /// zero.
    pub fn new(columns: [Vec<f64>; D], log_weights: &[f64]) -> Result<Self, Error> {
        if let Some(bad) = log_weights.iter().find(|w| w.is_nan() || **w == f64::INFINITY) {
            return Err(ArgumentError::new("log_weights", bad, "log weights below infinity").into());
        }
        let mut belief = Self::uniform(columns)?;
        if belief.len() != log_weights.len() {
            return Err(ArgumentError::new(
                "log_weights",
                format!("{} numbers", log_weights.len()),
                format!("{}, one a particle", belief.len()),
            )
            .into());
        }
        belief.reweigh(|_, own| own.copy_from_slice(log_weights))?;
        Ok(belief)
    }

    /// Equally weighted particles from their columns.
    ///
    /// # Errors
    /// Lengths that differ, no particle, a coordinate that is not finite.
    pub fn uniform(columns: [Vec<f64>; D]) -> Result<Self, Error> {
        let count = columns.first().map_or(0, Vec::len);
        at_least_one("particles", count)?;
        for column in &columns {
            if column.len() != count {
                return Err(ArgumentError::new(
                    "columns",
                    format!("a column of length {}", column.len()),
                    format!("length {count}, as the first column"),
                )
                .into());
            }
            all_finite("columns", column)?;
        }
        let mut belief = Self {
            columns,
            log_weights: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            effective_sample_size: 0.0,
            scratch: Vec::with_capacity(count),
        };
        belief.equalise(count);
        Ok(belief)
    }

    /// Equally weighted particles, drawn one after the other.
    ///
    /// # Errors
    /// No particle, or a draw that is not finite.
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

    /// Number of particles, at least one.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Never true: a belief has at least one particle.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// The coordinates, one contiguous column each.
    pub fn columns(&self) -> Columns<'_, D> {
        self.columns.each_ref().map(Vec::as_slice)
    }

    /// The coordinates for work in place, such as propagation. Finite numbers must stay finite.
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
        (i < self.len()).then(|| SVector::from_fn(|d, _| self.columns[d][i]))
    }

    /// `1 / sum w_i^2`, between 1 and the number of particles.
    pub fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// Lets `change` edit the log weights (typically: add log likelihoods) and normalises them. Returns
    /// `ln sum_i exp(log weight_i)` after the change: the log-likelihood estimate if log likelihoods were added.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if no weight is left or one is NaN or infinite; the belief is then as it was before.
    pub fn reweigh(&mut self, change: impl FnOnce(Columns<'_, D>, &mut [f64])) -> Result<f64, Error> {
        self.scratch.clear();
        self.scratch.extend_from_slice(&self.log_weights);
        change(self.columns.each_ref().map(Vec::as_slice), &mut self.scratch);
        let largest = largest(&self.scratch);
        if !largest.is_finite() {
            return Err(Error::Degenerate { largest });
        }
        let sums = exp_minus(&self.scratch, largest, &mut self.weights);
        let total = sums.sum;
        if !total.is_finite() {
            exp_minus(&self.log_weights, 0.0, &mut self.weights);
            return Err(Error::Degenerate { largest: total });
        }
        let log_sum = largest + total.ln();
        let scale = 1.0 / total;
        self.weights.iter_mut().for_each(|w| *w *= scale);
        self.scratch.iter_mut().for_each(|w| *w -= log_sum);
        std::mem::swap(&mut self.log_weights, &mut self.scratch);
        self.effective_sample_size = total * total / sums.sum_of_squares;
        Ok(log_sum)
    }

    /// Replaces the particles by copies of the chosen ones, equally weighted. Indices must be below [`len`](Self::len); the
    /// number of particles becomes that of the indices.
    ///
    /// # Errors
    /// No index, or one out of range; the belief is then as it was.
    pub fn select(&mut self, ancestors: &[u32]) -> Result<(), Error> {
        at_least_one("ancestors", ancestors.len())?;
        let count = self.len();
        if let Some(bad) = ancestors.iter().find(|a| **a as usize >= count) {
            return Err(ArgumentError::new("ancestors", bad, format!("indices below {count}")).into());
        }
        for column in &mut self.columns {
            self.scratch.clear();
            self.scratch.extend(ancestors.iter().map(|a| column[*a as usize]));
            std::mem::swap(column, &mut self.scratch);
        }
        self.equalise(ancestors.len());
        Ok(())
    }

    /// Gives all particles the same weight.
    pub fn equalise_weights(&mut self) {
        self.equalise(self.len());
    }

    fn equalise(&mut self, count: usize) {
        let weight = 1.0 / count as f64;
        self.weights.clear();
        self.weights.resize(count, weight);
        self.log_weights.clear();
        self.log_weights.resize(count, weight.ln());
        self.effective_sample_size = count as f64;
    }

    /// Weighted mean.
    pub fn mean(&self) -> SVector<f64, D> {
        SVector::from_fn(|d, _| dot(&self.weights, &self.columns[d]))
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

    /// Weighted covariance about the mean.
    pub fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance_about(&self.mean())
    }
}

/// `clone_from` reuses memory, so that a filter can keep a belief to fall back to without allocating.
impl<const D: usize> Clone for Particles<D> {
    fn clone(&self) -> Self {
        Self {
            columns: self.columns.clone(),
            log_weights: self.log_weights.clone(),
            weights: self.weights.clone(),
            effective_sample_size: self.effective_sample_size,
            scratch: Vec::with_capacity(self.len()),
        }
    }

    fn clone_from(&mut self, other: &Self) {
        self.columns.clone_from(&other.columns);
        self.log_weights.clone_from(&other.log_weights);
        self.weights.clone_from(&other.weights);
        self.effective_sample_size = other.effective_sample_size;
    }
}

/// Equality of the belief: columns and weights.
impl<const D: usize> PartialEq for Particles<D> {
    fn eq(&self, other: &Self) -> bool {
        self.columns == other.columns && self.log_weights == other.log_weights
    }
}

/// The plain form in which particles are stored. Weights rather than their logarithms: JSON has no infinity.
#[derive(Serialize, Deserialize)]
struct Stored {
    columns: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl<const D: usize> From<Particles<D>> for Stored {
    fn from(belief: Particles<D>) -> Self {
        Self {
            columns: belief.columns.into(),
            weights: belief.weights,
        }
    }
}

impl<const D: usize> TryFrom<Stored> for Particles<D> {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self, Error> {
        let columns = stored.columns.try_into().map_err(|columns: Vec<Vec<f64>>| {
            ArgumentError::new("columns", format!("{} columns", columns.len()), format!("{D} columns"))
        })?;
        let log_weights: Vec<f64> = stored.weights.iter().map(|w| w.ln()).collect();
        Self::new(columns, &log_weights)
    }
}
