//! Weighted particles in structure-of-arrays form.

use crate::Error;
use crate::sums::{dot, lanes, sum};
use fewbits_core::ArgumentError;
use fewbits_core::error::{all_finite, at_least_one};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// A belief `sum_i w_i delta(x - x_i)` over `R^D`.
///
/// Each coordinate is one contiguous column and the weights are logarithms, so that a filter's inner loops run over plain
/// slices and a weight cannot underflow. The weights need not be normalised: `log_weights` of equal size mean a uniform
/// belief whatever the size. [`normalise_into`](Self::normalise_into) is the one place where exponentials are taken; the
/// moments then use its result, so that a filter pays for one exponential a particle.
///
/// ```
/// use fewbits_densities::Particles;
/// let belief = Particles::new([vec![0.0, 1.0, 4.0]], vec![0.0, 0.0, f64::NEG_INFINITY])?;
/// assert_eq!(belief.mean()?[0], 0.5);
/// assert_eq!(belief.effective_sample_size()?, 2.0);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Particles<const D: usize> {
    columns: [Vec<f64>; D],
    log_weights: Vec<f64>,
}

/// What [`Particles::normalise_into`] learns on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalisation {
    /// `ln sum_i exp(log_weight_i)` before normalisation.
    pub log_sum: f64,
    /// `1 / sum_i w_i^2`, between 1 and the number of particles.
    pub effective_sample_size: f64,
}

impl<const D: usize> Particles<D> {
    /// Particles from their columns and log weights (of any common offset; `-inf` is a weight of zero).
    ///
    /// # Errors
    /// Lengths that differ, no particle, a coordinate that is not finite, a log weight that is NaN or `+inf`, or all weights
    /// zero.
    pub fn new(columns: [Vec<f64>; D], log_weights: Vec<f64>) -> Result<Self, Error> {
        at_least_one("particles", log_weights.len())?;
        for column in &columns {
            if column.len() != log_weights.len() {
                return Err(ArgumentError::new(
                    "columns",
                    format!("a column of length {}", column.len()),
                    format!("length {}, one entry a log weight", log_weights.len()),
                )
                .into());
            }
            all_finite("columns", column)?;
        }
        if let Some(bad) = log_weights.iter().find(|w| w.is_nan() || **w == f64::INFINITY) {
            return Err(ArgumentError::new("log_weights", bad, "log weights below infinity").into());
        }
        let belief = Self { columns, log_weights };
        belief.largest_log_weight()?;
        Ok(belief)
    }

    /// Equally weighted particles from their columns.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn uniform(columns: [Vec<f64>; D]) -> Result<Self, Error> {
        let count = columns.first().map_or(0, Vec::len);
        let weight = -(count.max(1) as f64).ln();
        Self::new(columns, vec![weight; count])
    }

    /// Equally weighted particles, drawn one after the other.
    ///
    /// # Errors
    /// No particle, or a draw that is not finite.
    pub fn from_draws(count: usize, mut draw: impl FnMut() -> SVector<f64, D>) -> Result<Self, Error> {
        at_least_one("particles", count)?;
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
        self.log_weights.len()
    }

    /// Never true: a belief has at least one particle.
    pub fn is_empty(&self) -> bool {
        self.log_weights.is_empty()
    }

    /// The coordinates, one contiguous column each.
    pub fn columns(&self) -> &[Vec<f64>; D] {
        &self.columns
    }

    /// The columns and log weights for work in place. The lengths must be left as they are, all equal.
    pub fn parts_mut(&mut self) -> (&mut [Vec<f64>; D], &mut Vec<f64>) {
        (&mut self.columns, &mut self.log_weights)
    }

    /// Logarithms of the weights, up to a common offset.
    pub fn log_weights(&self) -> &[f64] {
        &self.log_weights
    }

    /// Particle `i`, or `None` past the end.
    pub fn point(&self, i: usize) -> Option<SVector<f64, D>> {
        (i < self.len()).then(|| SVector::from_fn(|d, _| self.columns[d][i]))
    }

    /// Gives all particles the same weight.
    pub fn reset_weights(&mut self) {
        let weight = -(self.len() as f64).ln();
        self.log_weights.fill(weight);
    }

    fn largest_log_weight(&self) -> Result<f64, Error> {
        // `max` drops NaN, so a sum over the weights has to look for it.
        let largest = self.log_weights.iter().fold(f64::NEG_INFINITY, |m, w| m.max(*w));
        if largest.is_finite() {
            Ok(largest)
        } else {
            Err(Error::Degenerate { largest })
        }
    }

    /// Normalises the log weights to sum to one and writes the weights themselves to `weights` (resized as needed).
    ///
    /// # Errors
    /// [`Error::Degenerate`] if no weight is above zero or one is NaN; the belief is then left as it was.
    pub fn normalise_into(&mut self, weights: &mut Vec<f64>) -> Result<Normalisation, Error> {
        let normalisation = self.weights_into(weights)?;
        self.log_weights.iter_mut().for_each(|w| *w -= normalisation.log_sum);
        Ok(normalisation)
    }

    /// Writes the normalised weights to `weights` (resized as needed) and leaves the belief as it is.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if no weight is above zero or one is NaN.
    pub fn weights_into(&self, weights: &mut Vec<f64>) -> Result<Normalisation, Error> {
        let largest = self.largest_log_weight()?;
        weights.resize(self.len(), 0.0);
        for (w, l) in weights.iter_mut().zip(&self.log_weights) {
            *w = (l - largest).exp();
        }
        let total = sum(weights);
        if !total.is_finite() {
            return Err(Error::Degenerate { largest: total });
        }
        let scale = 1.0 / total;
        let mut squares = 0.0;
        for w in weights.iter_mut() {
            *w *= scale;
            squares += *w * *w;
        }
        Ok(Normalisation {
            log_sum: largest + total.ln(),
            effective_sample_size: 1.0 / squares,
        })
    }

    /// The normalised weights.
    ///
    /// # Errors
    /// [`Error::Degenerate`] as [`normalise_into`](Self::normalise_into).
    pub fn weights(&self) -> Result<Vec<f64>, Error> {
        let mut weights = Vec::new();
        self.weights_into(&mut weights)?;
        Ok(weights)
    }

    /// `1 / sum w_i^2` of the normalised weights.
    ///
    /// # Errors
    /// [`Error::Degenerate`] as [`normalise_into`](Self::normalise_into).
    pub fn effective_sample_size(&self) -> Result<f64, Error> {
        Ok(self.weights_into(&mut Vec::new())?.effective_sample_size)
    }

    /// Weighted mean.
    ///
    /// # Errors
    /// [`Error::Degenerate`] as [`normalise_into`](Self::normalise_into).
    pub fn mean(&self) -> Result<SVector<f64, D>, Error> {
        Ok(self.mean_with(&self.weights()?))
    }

    /// Weighted covariance `sum w (x - mean)(x - mean)^T`, without a small-sample correction.
    ///
    /// # Errors
    /// [`Error::Degenerate`] as [`normalise_into`](Self::normalise_into).
    pub fn covariance(&self) -> Result<SMatrix<f64, D, D>, Error> {
        let weights = self.weights()?;
        Ok(self.covariance_with(&weights, &self.mean_with(&weights)))
    }

    /// Weighted mean under weights already normalised, one a particle.
    pub fn mean_with(&self, weights: &[f64]) -> SVector<f64, D> {
        SVector::from_fn(|d, _| dot(weights, &self.columns[d]))
    }

    /// Weighted covariance about `mean` under weights already normalised, one a particle.
    pub fn covariance_with(&self, weights: &[f64], mean: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let mut covariance = SMatrix::zeros();
        for i in 0..D {
            for j in 0..=i {
                let (a, b) = (&self.columns[i], &self.columns[j]);
                let sum = lanes(weights.len(), |k| weights[k] * (a[k] - mean[i]) * (b[k] - mean[j]));
                covariance[(i, j)] = sum;
                covariance[(j, i)] = sum;
            }
        }
        covariance
    }
}

/// The plain form in which particles are stored.
#[derive(Serialize, Deserialize)]
struct Stored {
    columns: Vec<Vec<f64>>,
    log_weights: Vec<f64>,
}

impl<const D: usize> From<Particles<D>> for Stored {
    fn from(belief: Particles<D>) -> Self {
        Self {
            columns: belief.columns.into(),
            log_weights: belief.log_weights,
        }
    }
}

impl<const D: usize> TryFrom<Stored> for Particles<D> {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self, Error> {
        let columns = stored.columns.try_into().map_err(|columns: Vec<Vec<f64>>| {
            ArgumentError::new("columns", format!("{} columns", columns.len()), format!("{D} columns"))
        })?;
        Self::new(columns, stored.log_weights)
    }
}
