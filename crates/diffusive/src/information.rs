//! The information that the samples of a node would bring: mutual information, bounds of it, and Fisher information.

use crate::{Error, SourceSensor};
use fewbits_models::Receptor;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, positive, probabilities};
use fewbits_numerics::kernels;
use fewbits_numerics::normal::INV_SQRT_2PI;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

/// A discrete belief by its predicted noise-free samples, in units of the noise: one row per support point.
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

/// Spacing of the two-dimensional quadrature rule, in noise standard deviations.
const SPACING: f64 = 0.4;
const REACH: f64 = 8.0;

impl Predictions {
    /// Predicted samples of each support point (one list each, kg/m^3), the points' weights, and the noise's standard deviation.
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

    /// From predictions divided by the noise, of equal lengths, and weights that sum to one.
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
        let weights = &self.weights;
        let mut inner = [weights.clone(), weights.clone()];
        let (mut exponents, mut overlaps) = (vec![0.0; weights.len()], vec![0.0; weights.len()]);
        for i in 1..weights.len() {
            let (exponents, overlaps) = (&mut exponents[..i], &mut overlaps[..i]);
            exponents.fill(0.0);
            for column in self.means.column_iter() {
                let own = column[i];
                for (exponent, other) in exponents.iter_mut().zip(column.iter()) {
                    *exponent -= 0.125 * (own - other) * (own - other);
                }
            }
            kernels::exp_minus(exponents, 0.0, overlaps);
            for (j, eighth) in overlaps.iter().enumerate() {
                // exp(-D / 2) is the fourth power of exp(-D / 8).
                let half = (eighth * eighth) * (eighth * eighth);
                for (sums, overlap) in inner.iter_mut().zip([*eighth, half]) {
                    sums[i] += weights[j] * overlap;
                    sums[j] += weights[i] * overlap;
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

    /// The mutual information, nats, by quadrature of the mixture's entropy. Exact for one or two samples. For more, predictions
    /// are projected on their two principal directions, which contain all but 4e-5 of their variance in this problem.
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
        let axis: Vec<f64> = (-steps..=steps).map(|i| f64::from(i) * SPACING).collect();
        let densities = axis.iter().map(|y| (-0.5 * y * y).exp() * INV_SQRT_2PI * SPACING);
        let densities: Vec<f64> = densities.collect();
        let mut total = 0.0;
        for (own, weight) in points.iter().zip(&self.weights).filter(|(_, w)| **w > 0.0) {
            // Components so far away have no density within the reach of the rule.
            let near = points.iter().zip(&self.weights).map(|(p, w)| (p - own, *w));
            let near = near.filter(|(p, w)| *w > 0.0 && p.norm() < 3.0 * REACH);
            // Ratio of the mixture's density to that of its component at every node: a sum of products of functions of each axis.
            let mut ratios = vec![0.0; axis.len() * axis.len()];
            for (p, w) in near {
                let [rows, columns] = [0, 1].map(|d| {
                    let along = axis.iter().map(|y| (p[d] * (y - 0.5 * p[d])).exp());
                    along.collect::<Vec<f64>>()
                });
                for (row, ratios) in rows.iter().zip(ratios.chunks_exact_mut(axis.len())) {
                    let share = w * row;
                    ratios
                        .iter_mut()
                        .zip(&columns)
                        .for_each(|(ratio, column)| *ratio += share * column);
                }
            }
            for (density, ratios) in densities.iter().zip(ratios.chunks_exact(axis.len())) {
                let along = ratios
                    .iter()
                    .zip(&densities)
                    .map(|(ratio, density)| density * ratio.ln());
                total -= weight * density * along.sum::<f64>();
            }
        }
        total
    }

    fn exact_on_the_line(&self) -> f64 {
        let column = self.means.column(0);
        let mut total = 0.0;
        for (i, w) in self.weights.iter().enumerate() {
            total += w * gauss_legendre::<16>().composite(-10.0, 10.0, 80, |y| {
                let density = (-0.5 * y * y).exp() * INV_SQRT_2PI;
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

/// Fisher information of the samples at a receptor about (x, y, rate) of a source at `source` with release rate `rate`:
/// `sum_j grad(mu a_j) grad(mu a_j)' / sigma^2`.
pub(crate) fn information_at(
    sensor: &SourceSensor,
    receptor: &Receptor,
    source: &Vector2<f64>,
    rate: f64,
) -> Matrix3<f64> {
    let mut information = Matrix3::zeros();
    for j in 0..sensor.instants().len() {
        let at = sensor.response_gradient_at(j, receptor, source);
        let slope = Vector3::new(rate * at.gradient.x, rate * at.gradient.y, at.value) / sensor.noise();
        information += slope * slope.transpose();
    }
    information
}

/// Parameters that [`fisher_information`] can treat as unknown.
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

fn no_diffusivity() -> ArgumentError {
    ArgumentError::new(
        "unknowns",
        "the diffusivity",
        "a model with `diffusivity_slope`: this one has not one diffusivity",
    )
}

/// Fisher information of all nodes together about the parameters `unknowns`, in this order. The derivative by the start of the release
/// is a finite difference with a step of 1e-5 of the shortest age.
///
/// # Errors
/// If the model has no concentrations at a node, or no diffusivity that could change although it is an unknown.
pub fn fisher_information(
    unknowns: &[Unknown],
    sensor: &SourceSensor,
    nodes: &[Vector2<f64>],
    source: &Vector2<f64>,
    rate: f64,
) -> Result<DMatrix<f64>, Error> {
    let step = 1e-5 * sensor.shortest_age();
    // The derivative by the start is a central difference; all others are exact.
    let earlier = sensor.clone().with_start(sensor.start() - step)?;
    let later = sensor.clone().with_start(sensor.start() + step)?;
    let place = sensor.source_at(source);
    let mut information = DMatrix::zeros(unknowns.len(), unknowns.len());
    for node in nodes {
        let receptor = sensor.receptor(node)?;
        let shifted = [
            earlier.responses_at(&receptor, source),
            later.responses_at(&receptor, source),
        ];
        for (j, age) in sensor.ages().iter().enumerate() {
            let at = sensor.response_gradient_at(j, &receptor, source);
            let slope = |unknown: &Unknown| {
                Ok(match unknown {
                    Unknown::X => rate * at.gradient.x,
                    Unknown::Y => rate * at.gradient.y,
                    Unknown::Rate => at.value,
                    Unknown::Diffusivity => {
                        let slope = sensor.model().diffusivity_slope(&receptor, &place, *age);
                        rate * slope.ok_or_else(no_diffusivity)?
                    }
                    Unknown::Start => rate * (shifted[1][j] - shifted[0][j]) / (2.0 * step),
                    Unknown::Bias => 1.0,
                } / sensor.noise())
            };
            let slopes = unknowns.iter().map(slope).collect::<Result<Vec<f64>, Error>>()?;
            let slopes = DVector::from_vec(slopes);
            information += &slopes * slopes.transpose();
        }
    }
    Ok(information)
}
