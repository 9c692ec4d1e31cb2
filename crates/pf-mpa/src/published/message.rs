//! Messages of particle message passing over the plane: points under a common kernel.

use crate::Error;
use crate::error::refuse;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::kernels;
use nalgebra::{Matrix2, Vector2};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// How the kernel of a message is chosen: a covariance `lambda C`, `C` the weighted covariance of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KernelRule {
    /// `lambda = N^(-1/6)`, the printed factor: that of the standard deviation in two dimensions (erratum `mpa-5`).
    Printed,
    /// `lambda = (4 / ((d + 2) N))^(2/(d + 4))` with the effective sample size.
    Silverman,
    /// For rings, as narrow as the spacing of their points; the prediction by Silverman's rule.
    Narrow,
}

/// From which bearings a ring message is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ring {
    /// All around, as printed.
    Full,
    /// Those where the prediction is.
    Local,
}

/// Weights of the points of a ring message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RingWeight {
    /// All the same: a uniform bearing makes the plane density proportional to `l(d) / d` (erratum `mpa-3`).
    Uniform,
    /// The radius, so that the message is the likelihood `l(d)` over the plane.
    Jacobian,
    /// The printed ratio `sum_j f(x_i | X_j) / f(x_i | X_i)`.
    PrintedRatio,
}

/// Weights of the predicted points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DynamicsWeight {
    /// All the same: one draw from each component is an exact stratified sample (erratum `mpa-4`).
    Uniform,
    /// The printed ratio, evaluated on the position, where the transition has a density (erratum `mpa-16`).
    PrintedRatio,
}

/// A message over the plane: weighted points under a common Gaussian kernel.
#[derive(Debug, Clone, Default)]
pub(crate) struct KernelMessage {
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    /// Logarithms of the weights; any offset until [`KernelMessage::finish`], normalised after it.
    pub(crate) log_weights: Vec<f64>,
    pub(crate) cumulative: Vec<f64>,
    pub(crate) kernel: Matrix2<f64>,
    /// `1 / sum w^2`.
    pub(crate) effective: f64,
    /// Points in the coordinates that whiten their own kernel plus the rest of the product.
    pub(crate) white: [Vec<f64>; 2],
}

impl KernelMessage {
    pub(crate) fn resize(&mut self, count: usize) {
        for buffer in [&mut self.x, &mut self.y, &mut self.log_weights, &mut self.cumulative] {
            buffer.resize(count, 0.0);
        }
        self.white.iter_mut().for_each(|w| w.resize(count, 0.0));
    }

    pub(crate) fn weight(&self, i: usize) -> f64 {
        let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        self.cumulative[i] - before
    }

    /// Normalises the weights and returns mean and covariance of the points. Weights that underflow altogether count as equal;
    /// the second number says so.
    pub(crate) fn finish(&mut self) -> (Vector2<f64>, Matrix2<f64>, u32) {
        let count = self.x.len();
        let largest = kernels::largest(&self.log_weights);
        let mut fallbacks = 0;
        if !largest.is_finite() {
            self.log_weights.fill(0.0);
            fallbacks = 1;
        }
        let offset = if fallbacks == 1 { 0.0 } else { largest };
        let total: f64 = self.log_weights.iter().map(|l| (l - offset).exp()).sum();
        let (mut sum, mut squares, mut mean) = (0.0, 0.0, Vector2::zeros());
        for i in 0..count {
            let w = (self.log_weights[i] - offset).exp() / total;
            self.log_weights[i] -= offset + total.ln();
            sum += w;
            squares += w * w;
            self.cumulative[i] = sum;
            mean += Vector2::new(self.x[i], self.y[i]) * w;
        }
        self.effective = 1.0 / squares;
        let mut covariance = Matrix2::zeros();
        for i in 0..count {
            let d = Vector2::new(self.x[i], self.y[i]) - mean;
            covariance += d * d.transpose() * self.weight(i);
        }
        (mean, covariance, fallbacks)
    }

    /// A label by its weight.
    pub(crate) fn label<R: Rng + ?Sized>(&self, rng: &mut R) -> usize {
        let u: f64 = rng.random();
        self.cumulative
            .partition_point(|c| *c <= u)
            .min(self.cumulative.len().saturating_sub(1))
    }

    /// Systematic draws by weight; equal weights give every point once.
    pub(crate) fn resample<R: Rng + ?Sized>(&self, rng: &mut R, labels: &mut [usize]) {
        let (offset, count, last) = (rng.random::<f64>(), labels.len() as f64, self.x.len().saturating_sub(1));
        let mut label = 0;
        for (n, drawn) in labels.iter_mut().enumerate() {
            while label < last && self.cumulative[label] * count <= n as f64 + offset {
                label += 1;
            }
            *drawn = label;
        }
    }

    pub(crate) fn point(&self, i: usize) -> Vector2<f64> {
        Vector2::new(self.x[i], self.y[i])
    }

    /// As a mixture of the densities crate.
    pub(crate) fn mixture(&self) -> Result<Mixture<2>, Error> {
        let components = (0..self.x.len()).map(|i| Component::new(self.weight(i), self.point(i), self.kernel));
        Ok(Mixture::new(components.collect::<Result<_, _>>()?)?)
    }
}

/// Scales a covariance to a kernel. One without spread in some direction is widened by a millionth of its trace.
///
/// # Errors
/// If the covariance is zero or no number.
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

/// Integrated squared error of a kernel estimate of `n` draws from the standard normal density in `d` dimensions, its kernel of
/// covariance `lambda I`, in expectation; exact.
pub fn kernel_error(n: f64, d: u32, lambda: f64) -> f64 {
    let power = |x: f64| x.powf(-0.5 * f64::from(d));
    let sum = power(lambda) / n + (1.0 - 1.0 / n) * power(1.0 + lambda) - 2.0 * power(1.0 + 0.5 * lambda) + 1.0;
    sum * power(4.0 * std::f64::consts::PI)
}
