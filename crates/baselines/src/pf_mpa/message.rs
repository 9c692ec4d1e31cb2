//! Messages of particle message passing: weighted points under a common kernel.

use fewbits_core::columns::set_state;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels;
use fewbits_pf_mpa::Error;
use nalgebra::{Matrix2, SMatrix, SVector};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// How the kernel of a message is chosen. Its covariance is `lambda C`, `C` the weighted covariance of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KernelRule {
    /// `lambda = N^(-1/6)`, as printed: in two dimensions the factor for the standard deviation, not the covariance (erratum `mpa-5`).
    Printed,
    /// `lambda = (4 / ((d + 2) N))^(2/(d + 4))` with the effective sample size.
    Silverman,
    /// Rings: kernels as narrow as the spacing of the points. The prediction: Silverman's rule.
    Narrow,
}

/// From which bearings the points of a ring message are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ring {
    /// All bearings, as printed.
    Full,
    /// The bearings towards the predicted position.
    Local,
}

/// Weights of the points of a ring message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RingWeight {
    /// Equal weights. With a uniform bearing the density over the plane is then proportional to `l(d) / d` (erratum `mpa-3`).
    Uniform,
    /// Proportional to the radius, so that the message is the likelihood `l(d)` over the plane.
    Jacobian,
    /// The printed ratio `sum_j f(x_i | X_j) / f(x_i | X_i)`.
    PrintedRatio,
}

/// Weights of the predicted points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DynamicsWeight {
    /// Equal weights: one draw from each component is an exact stratified sample (erratum `mpa-4`).
    Uniform,
    /// The printed ratio, evaluated on the position, for which the transition has a density (erratum `mpa-16`).
    PrintedRatio,
}

/// Weighted points under a common Gaussian kernel: a mixture whose components share their covariance.
#[derive(Debug, Clone)]
pub(crate) struct KernelMessage<const D: usize> {
    pub(crate) points: [Vec<f64>; D],
    /// Logarithms of the weights, up to a constant before [`KernelMessage::finish`], normalised after it.
    pub(crate) log_weights: Vec<f64>,
    pub(crate) cumulative: Vec<f64>,
    pub(crate) kernel: SMatrix<f64, D, D>,
    /// Effective sample size `1 / sum w^2`.
    pub(crate) effective: f64,
    /// Points, whitened by the covariance of their kernel plus that of the product of the other messages.
    pub(crate) white: Vec<SVector<f64, D>>,
}

impl<const D: usize> KernelMessage<D> {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            points: std::array::from_fn(|_| vec![0.0; count]),
            log_weights: vec![0.0; count],
            cumulative: vec![0.0; count],
            kernel: SMatrix::zeros(),
            effective: 0.0,
            white: vec![SVector::zeros(); count],
        }
    }

    /// The message of a mixture.
    pub(crate) fn of(mixture: &Mixture<D>) -> Result<Self, Error> {
        let (mut message, components) = (Self::new(mixture.len()), mixture.components());
        message.kernel = *components[0].covariance();
        for (i, component) in components.iter().enumerate() {
            if *component.covariance() != message.kernel {
                return refuse("factors", "a mixture of different covariances", "one covariance in each mixture");
            }
            set_state(&mut message.points.each_mut().map(Vec::as_mut_slice), i, component.mean());
            message.log_weights[i] = component.weight().ln();
        }
        message.finish();
        Ok(message)
    }

    pub(crate) fn resize(&mut self, count: usize) {
        for buffer in self
            .points
            .iter_mut()
            .chain([&mut self.log_weights, &mut self.cumulative])
        {
            buffer.resize(count, 0.0);
        }
        self.white.resize(count, SVector::zeros());
    }

    /// Adds `by` to all points.
    pub(crate) fn shift(&mut self, by: &SVector<f64, D>) {
        for (column, by) in self.points.iter_mut().zip(by.iter()) {
            column.iter_mut().for_each(|x| *x += by);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.log_weights.len()
    }

    pub(crate) fn weight(&self, i: usize) -> f64 {
        let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        self.cumulative[i] - before
    }

    /// Normalises the weights and returns mean and covariance of the points, and the number of fallbacks: 1 if all weights underflowed and
    /// were replaced by equal ones, else 0.
    pub(crate) fn finish(&mut self) -> (SVector<f64, D>, SMatrix<f64, D, D>, u32) {
        let count = self.len();
        let largest = kernels::largest(&self.log_weights);
        let mut fallbacks = 0;
        // All weights zero: equal ones replace them, and the fallback is counted.
        if !largest.is_finite() {
            self.log_weights.fill(0.0);
            fallbacks = 1;
        }
        let offset = if fallbacks == 1 { 0.0 } else { largest };
        let total: f64 = self.log_weights.iter().map(|l| (l - offset).exp()).sum();
        let (mut sum, mut squares, mut mean) = (0.0, 0.0, SVector::zeros());
        for i in 0..count {
            let w = (self.log_weights[i] - offset).exp() / total;
            self.log_weights[i] -= offset + total.ln();
            sum += w;
            squares += w * w;
            self.cumulative[i] = sum;
            mean += self.point(i) * w;
        }
        self.effective = 1.0 / squares;
        let mut covariance = SMatrix::zeros();
        for i in 0..count {
            let d = self.point(i) - mean;
            covariance += d * d.transpose() * self.weight(i);
        }
        (mean, covariance, fallbacks)
    }

    /// Draws the index of a point with the probability of its weight.
    pub(crate) fn label<R: Rng + ?Sized>(&self, rng: &mut R) -> usize {
        let u: f64 = rng.random();
        self.cumulative
            .partition_point(|c| *c <= u)
            .min(self.cumulative.len().saturating_sub(1))
    }

    /// Systematic draws of indices by weight. Equal weights give every index once.
    pub(crate) fn resample<R: Rng + ?Sized>(&self, rng: &mut R, labels: &mut [usize]) {
        let (offset, count, last) = (rng.random::<f64>(), labels.len() as f64, self.len().saturating_sub(1));
        let mut label = 0;
        for (n, drawn) in labels.iter_mut().enumerate() {
            while label < last && self.cumulative[label] * count <= n as f64 + offset {
                label += 1;
            }
            *drawn = label;
        }
    }

    pub(crate) fn point(&self, i: usize) -> SVector<f64, D> {
        SVector::from_fn(|d, _| self.points[d][i])
    }

    /// The message as a [`Mixture`].
    pub(crate) fn mixture(&self) -> Result<Mixture<D>, Error> {
        let components = (0..self.len()).map(|i| Component::new(self.weight(i), self.point(i), self.kernel));
        Mixture::new(components.collect::<Result<_, _>>()?)
    }
}

/// `lambda` times a covariance. If it is singular, a millionth of its trace is added first, and the second number is 1.
///
/// # Errors
/// If the covariance is zero or not finite.
pub(crate) fn kernel_of(covariance: &Matrix2<f64>, lambda: f64) -> Result<(Matrix2<f64>, u32), Error> {
    let kernel = covariance * lambda;
    let trace = kernel.trace();
    let singular = kernel.determinant() <= 1e-9 * trace * trace;
    if !(trace > 0.0 && trace.is_finite()) {
        return refuse("message", "points without spread", "points that do not coincide");
    }
    if singular {
        return Ok((kernel + Matrix2::identity() * (1e-6 * trace), 1));
    }
    Ok((kernel, 0))
}

/// Exact expected integrated squared error of a kernel estimate from `n` draws of the standard normal density in `d` dimensions. The
/// kernel has covariance `lambda I`.
pub fn kernel_error(n: f64, d: u32, lambda: f64) -> f64 {
    let power = |x: f64| x.powf(-0.5 * f64::from(d));
    let sum = power(lambda) / n + (1.0 - 1.0 / n) * power(1.0 + lambda) - 2.0 * power(1.0 + 0.5 * lambda) + 1.0;
    sum * power(4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_without_spread_are_refused_or_widened() {
        assert!(kernel_of(&Matrix2::zeros(), 0.3).is_err());
        assert_eq!(kernel_of(&Matrix2::new(1.0, 1.0, 1.0, 1.0), 0.3).unwrap().1, 1);
    }
}
