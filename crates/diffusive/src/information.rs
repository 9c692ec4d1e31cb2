//! How much the samples of a node would tell: mutual information, bounds of it, and Fisher information.

use crate::{Error, SourceSensor};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, positive, probabilities};
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

/// A discrete belief as the noise-free samples it predicts, in units of the noise: one row a support point.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    means: DMatrix<f64>,
    weights: Vec<f64>,
}

/// Lower and upper bound, nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

/// Spacing and reach of the two-dimensional rule, in noise standard deviations.
const SPACING: f64 = 0.4;
const REACH: f64 = 8.0;

impl Predictions {
    /// Predicted samples of each support point (one list each, kg/m^3), their weights, and the standard deviation of the noise.
    ///
    /// # Errors
    /// If there is no point, lists differ in length or are empty, a number is not finite, the weights are no probabilities, or
    /// `noise` is not positive.
    pub fn new(means: &[Vec<f64>], weights: &[f64], noise: f64) -> Result<Self, ArgumentError> {
        positive("noise", noise)?;
        probabilities("weights", weights)?;
        let samples = means.first().map_or(0, Vec::len);
        if means.len() != weights.len() || samples == 0 || means.iter().any(|m| m.len() != samples) {
            return Err(ArgumentError::new("means", "of other lengths", "one list of equal length for each weight"));
        }
        for list in means {
            all_finite("means", list)?;
        }
        Ok(Self {
            means: DMatrix::from_fn(means.len(), samples, |i, j| means[i][j] / noise),
            weights: weights.to_vec(),
        })
    }

    /// Predictions over the noise, of equal lengths, with weights that sum to one.
    pub(crate) fn in_units_of_noise(means: &[DVector<f64>], weights: Vec<f64>) -> Self {
        let samples = means.first().map_or(0, DVector::len);
        Self {
            means: DMatrix::from_fn(means.len(), samples, |i, j| means[i][j]),
            weights,
        }
    }

    /// `-sum_i w_i ln sum_j w_j exp(-D_ij / 8)` and the same with `D_ij / 2`, `D_ij` the squared distance of predictions in noise
    /// standard deviations (Kolchinsky and Tracey 2017): bounds of the mutual information, nats.
    pub fn pairwise_bounds(&self) -> Bounds {
        let points = self.means.transpose();
        let count = self.weights.len();
        let mut inner = [self.weights.clone(), self.weights.clone()];
        for i in 0..count {
            for j in 0..i {
                let squared = (points.column(i) - points.column(j)).norm_squared();
                for (sums, divisor) in inner.iter_mut().zip([8.0, 2.0]) {
                    let overlap = (-squared / divisor).exp();
                    sums[i] += self.weights[j] * overlap;
                    sums[j] += self.weights[i] * overlap;
                }
            }
        }
        let [lower, upper] = inner.map(|sums| {
            -self
                .weights
                .iter()
                .zip(&sums)
                .map(|(w, sum)| if *w > 0.0 { w * sum.ln() } else { 0.0 })
                .sum::<f64>()
        });
        Bounds { lower, upper }
    }

    /// `(1/2) ln det(I + Cov / sigma^2)`: the mutual information if the predictions were Gaussian, and an upper bound of it, nats.
    pub fn gaussian_bound(&self) -> f64 {
        half_log_det_plus_one(self.covariance())
    }

    fn covariance(&self) -> DMatrix<f64> {
        let samples = self.means.ncols();
        let mut mean = DVector::zeros(samples);
        for (i, w) in self.weights.iter().enumerate() {
            mean += self.means.row(i).transpose() * *w;
        }
        let mut covariance = DMatrix::zeros(samples, samples);
        for (i, w) in self.weights.iter().enumerate() {
            let d = self.means.row(i).transpose() - &mean;
            covariance += &d * d.transpose() * *w;
        }
        covariance
    }

    /// The mutual information, nats, by quadrature of the mixture's entropy: exact for one or two samples; for more, predictions
    /// are projected on their two principal directions, which hold all but 4e-5 of their variance in this problem.
    pub fn exact(&self) -> f64 {
        if self.means.ncols() == 1 {
            return self.exact_on_the_line();
        }
        let eigen = self.covariance().symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let axis = |k: usize| eigen.eigenvectors.column(order[k]);
        let points: Vec<Vector2<f64>> = (0..self.means.nrows())
            .map(|i| {
                Vector2::new(self.means.row(i).transpose().dot(&axis(0)), self.means.row(i).transpose().dot(&axis(1)))
            })
            .collect();
        let steps = (REACH / SPACING) as i32;
        let mut total = 0.0;
        for (own, weight) in points.iter().zip(&self.weights) {
            let near: Vec<(Vector2<f64>, f64)> = points
                .iter()
                .zip(&self.weights)
                .map(|(p, w)| (p - own, *w))
                .filter(|(p, w)| *w > 0.0 && p.norm() < 3.0 * REACH)
                .collect();
            let mut expectation = 0.0;
            for i in -steps..=steps {
                for j in -steps..=steps {
                    let y = Vector2::new(f64::from(i), f64::from(j)) * SPACING;
                    let density = (-0.5 * y.norm_squared()).exp() / std::f64::consts::TAU;
                    let ratio: f64 = near
                        .iter()
                        .map(|(p, w)| w * (p.dot(&y) - 0.5 * p.norm_squared()).exp())
                        .sum();
                    expectation -= density * SPACING * SPACING * ratio.ln();
                }
            }
            total += weight * expectation;
        }
        total
    }

    fn exact_on_the_line(&self) -> f64 {
        let column = self.means.column(0);
        let mut total = 0.0;
        for (i, w) in self.weights.iter().enumerate() {
            total += w * gauss_legendre::<16>().composite(-10.0, 10.0, 80, |y| {
                let density = (-0.5 * y * y).exp() * fewbits_numerics::normal::INV_SQRT_2PI;
                let parts = column.iter().zip(&self.weights).map(|(m, v)| {
                    let d = m - column[i];
                    v * (d * y - 0.5 * d * d).exp()
                });
                -density * parts.sum::<f64>().ln()
            });
        }
        total
    }
}

/// `(1/2) ln det(I + m)` of a positive semidefinite matrix.
pub(crate) fn half_log_det_plus_one(m: DMatrix<f64>) -> f64 {
    let size = m.nrows();
    match (m + DMatrix::identity(size, size)).cholesky() {
        Some(factor) => factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum(),
        None => 0.0,
    }
}

/// Fisher information that the samples of a node hold about (x, y, rate) of a source at `source` with release rate `rate`:
/// `sum_j grad(mu a_j) grad(mu a_j)' / sigma^2`.
pub fn fisher_information(
    sensor: &SourceSensor,
    node: &Vector2<f64>,
    source: &Vector2<f64>,
    rate: f64,
) -> Matrix3<f64> {
    let mut information = Matrix3::zeros();
    for j in 0..sensor.instants().len() {
        let (a, gradient) = sensor.response_gradient(j, node, source);
        let slope = Vector3::new(rate * gradient.x, rate * gradient.y, a) / sensor.noise();
        information += slope * slope.transpose();
    }
    information
}

/// Parameters besides position and rate that [`fisher_information_of`] can treat as unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unknown {
    /// Horizontal position, x.
    X,
    /// Horizontal position, y.
    Y,
    /// Release rate.
    Rate,
    /// Diffusivity.
    Diffusivity,
    /// Start of the release.
    Start,
    /// Common bias of the sensors.
    Bias,
}

/// Fisher information that nodes together hold about any of the parameters, by central differences of relative step 1e-5 where no
/// closed form is at hand.
///
/// # Errors
/// If a perturbed sensor cannot be formed.
pub fn fisher_information_of(
    unknowns: &[Unknown],
    sensor: &SourceSensor,
    nodes: &[Vector2<f64>],
    source: &Vector2<f64>,
    rate: f64,
) -> Result<DMatrix<f64>, Error> {
    use fewbits_models::diffusion::{Air, Ground, ImpulseResponse};
    let step = 1e-5;
    let diffusivity = sensor.air().diffusivity();
    let shortest = sensor
        .instants()
        .iter()
        .map(|t| t - sensor.start())
        .filter(|age| *age > 0.0)
        .fold(f64::INFINITY, f64::min);
    let with_diffusivity = |k: f64| -> Result<SourceSensor, Error> {
        let air = Air::new(k, *sensor.air().wind(), Ground::Impermeable)?;
        SourceSensor::new(air, sensor.instants().to_vec(), sensor.noise())?.with_start(sensor.start())
    };
    let slower = with_diffusivity(diffusivity * (1.0 - step))?;
    let faster = with_diffusivity(diffusivity * (1.0 + step))?;
    let earlier = sensor.clone().with_start(sensor.start() - step * shortest)?;
    let later = sensor.clone().with_start(sensor.start() + step * shortest)?;
    let mut information = DMatrix::zeros(unknowns.len(), unknowns.len());
    for node in nodes {
        let moved = [slower.responses(node, source), faster.responses(node, source)];
        let shifted = [earlier.responses(node, source), later.responses(node, source)];
        for j in 0..sensor.instants().len() {
            let (a, gradient) = sensor.response_gradient(j, node, source);
            let slope = DVector::from_iterator(
                unknowns.len(),
                unknowns.iter().map(|unknown| match unknown {
                    Unknown::X => rate * gradient.x,
                    Unknown::Y => rate * gradient.y,
                    Unknown::Rate => a,
                    Unknown::Diffusivity => rate * (moved[1][j] - moved[0][j]) / (2.0 * step * diffusivity),
                    Unknown::Start => rate * (shifted[1][j] - shifted[0][j]) / (2.0 * step * shortest),
                    Unknown::Bias => 1.0,
                }),
            ) / sensor.noise();
            information += &slope * slope.transpose();
        }
    }
    Ok(information)
}
