//! The model of the observations: the prior of a scalar unknown and the noise of each sensor, on quadrature nodes.
//!
//! `Y_n = X + a_n U + d_n V_n` with `U` and all `V_n` standard normal. Given `X` and the shared factor `U` the sensors are
//! independent, so every joint probability is a sum of products of one-dimensional cell probabilities with positive
//! weights. This keeps relative accuracy in far cells, where differences of bivariate distribution functions lose it.
//!
//! Gaussian priors, mixtures and the smoothed density of a sample are integrated by the trapezoid rule, whose error falls faster
//! than any power of the step for these integrands; Gauss-Hermite rules need many more nodes if the noise is narrower than the
//! prior. Densities on an interval use Gauss-Legendre panels. A discrete prior is its own rule.

mod by_function;
mod nodes;
mod noise;
mod prior;
mod resolution;
mod sample;

pub use noise::Noise;
pub use prior::Prior;
pub(crate) use resolution::Resolution;
pub use sample::SampleFit;

use crate::error::{Error, refuse};
use crate::outcomes::NodeWeights;
use fewbits_numerics::normal;
use nodes::PRIOR_STEP;
use resolution::{NODE_LIMIT, grid, too_fine};
use serde::{Deserialize, Serialize};

/// Half-width of the quadrature rule for the shared factor, in its standard deviations.
const FACTOR_REACH: f64 = 8.5;
/// Largest step of the prior's rule in units of the narrowest noise. With folded cells, zeros of `P(x)`, at which `P ln P` is
/// singular, are close to the real axis. In noise of 0.3 the error of information is 3e-8 with step 0.4 and 3e-12 with 0.2 (measured).
const ENTROPY_STEP: f64 = 0.2;
/// The same for products of cell probabilities of two sensors, which are entire functions. With more sensors they are sharper.
const PRODUCT_STEP: f64 = 0.4;

/// The smallest independent noise with which designs are searched, as a share of the deviation of a normal prior or of the narrowest part
/// of a mixture. It moves breakpoints by less than 1e-4 of that deviation, which Newton's method on the exact model mends.
const SEARCHED: f64 = 1e-2;

/// The prior of the unknown and the noise of all sensors, on quadrature nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredModel", into = "StoredModel")]
pub struct ObservationModel {
    prior: Prior,
    noise: Noise,
    /// Values of `X` and their probabilities.
    pub(crate) values: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    /// Given a node the sensors are independent, and sensor `n` has mean `base + loading_n * factor`.
    nodes: Vec<Node>,
    /// `P(node | x_k)`.
    pub(crate) given: Vec<NodeWeights>,
    /// Sums over the prior: `sum_k w_k P(node | x_k)` and the same with `w_k (x_k - mean)`.
    pub(crate) mass: NodeWeights,
    pub(crate) moment: NodeWeights,
    /// Prior mean, about which moments are taken, and variance.
    pub(crate) mean: f64,
    pub(crate) variance: f64,
}

/// A value of the unknown (or of the unknown plus shared noise), and one of the shared factor.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    base: f64,
    factor: f64,
}

/// The stored form of [`ObservationModel`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredModel {
    prior: Prior,
    noise: Noise,
}

impl From<ObservationModel> for StoredModel {
    fn from(model: ObservationModel) -> Self {
        Self {
            prior: model.prior,
            noise: model.noise,
        }
    }
}

impl TryFrom<StoredModel> for ObservationModel {
    type Error = Error;

    fn try_from(parts: StoredModel) -> Result<Self, Error> {
        ObservationModel::new(parts.prior, parts.noise)
    }
}

impl ObservationModel {
    /// Discretises a prior and the noise of all sensors on quadrature nodes.
    ///
    /// # Errors
    /// If the noise is so much narrower than the prior that more than a million nodes would be needed, or squares of the
    /// prior's values overflow.
    pub fn new(prior: Prior, noise: Noise) -> Result<Self, Error> {
        Self::resolved(prior, noise, Resolution::FULL)
    }

    /// The model on fewer nodes.
    pub(crate) fn at(&self, resolution: Resolution) -> Result<Self, Error> {
        Self::resolved(self.prior.clone(), self.noise.clone(), resolution)
    }

    fn resolved(prior: Prior, noise: Noise, resolution: Resolution) -> Result<Self, Error> {
        // The product over many sensors is narrower than one factor: the step shrinks with the root of their number.
        let crowd = (noise.sensors().max(2) as f64 / 2.0).sqrt();
        let narrowest = (0..noise.sensors())
            .map(|n| noise.deviation(n))
            .fold(f64::INFINITY, f64::min);
        let noise_step = resolution.step * f64::min(ENTROPY_STEP, PRODUCT_STEP / crowd) * narrowest;
        let (values, weights) = prior.nodes(noise_step, resolution)?;
        let (weights, mean) = (normalised(weights), prior.mean());
        let weighted_square = |(x, w): (&f64, &f64)| w * (x - mean) * (x - mean);
        let variance: f64 = values.iter().zip(&weights).map(weighted_square).sum();
        let in_range = |x: &f64| ((x - mean) * (x - mean)).is_finite();
        if !variance.is_finite() || !values.iter().all(in_range) {
            let shown = format!("mean {mean}, variance {variance}");
            return refuse("prior", shown, "a prior with values whose squares are in the range of numbers");
        }
        let (nodes, given) = if noise.is_independent() {
            let itself = |start| NodeWeights {
                start,
                weights: vec![1.0],
            };
            let nodes = values.iter().map(|x| Node { base: *x, factor: 0.0 });
            (nodes.collect(), (0..values.len()).map(itself).collect())
        } else {
            match on_one_axis(&prior, &noise, &values, crowd, resolution)? {
                Some(found) => found,
                None => on_two_axes(&noise, &values, crowd, resolution)?,
            }
        };
        let (mut mass, mut moment) = (vec![0.0; nodes.len()], vec![0.0; nodes.len()]);
        for ((feature, w), x) in given.iter().zip(&weights).zip(&values) {
            for (i, p) in feature.weights.iter().enumerate() {
                mass[feature.start + i] += w * p;
                moment[feature.start + i] += w * (x - mean) * p;
            }
        }
        Ok(Self {
            prior,
            noise,
            values,
            weights,
            nodes,
            given,
            mass: NodeWeights::of_all(mass),
            moment: NodeWeights::of_all(moment),
            mean,
            variance,
        })
    }

    /// The model on which designs are searched: independent noises below [`SEARCHED`] are raised to it, since the number of nodes grows as
    /// their reciprocal.
    pub(crate) fn searched(&self) -> Result<Self, Error> {
        match self.prior.finest() {
            Some(finest) if self.noise.is_independent() => {
                let noise = self.noise.at_least(SEARCHED * finest)?;
                if noise == self.noise {
                    Ok(self.clone())
                } else {
                    Self::new(self.prior.clone(), noise)
                }
            }
            _ => Ok(self.clone()),
        }
    }

    /// A Gaussian prior and sensors with independent noise, all given by their standard deviations.
    ///
    /// # Errors
    /// As [`Prior::normal`], [`Noise::independent_with_deviations`] and [`ObservationModel::new`].
    pub fn gaussian_with_deviations(prior: f64, noise: &[f64]) -> Result<Self, Error> {
        Self::new(Prior::normal(0.0, prior)?, Noise::independent_with_deviations(noise)?)
    }

    /// The prior.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// The noise.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// Number of sensors.
    pub fn sensors(&self) -> usize {
        self.noise.sensors()
    }

    /// Values of the unknown on which the prior is represented.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Probability of each value.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Standard deviation of sensor `n`'s sample.
    pub fn sample_deviation(&self, n: usize) -> f64 {
        self.prior.deviation().hypot(self.noise.deviation(n))
    }

    /// The same prior with only some of the sensors.
    ///
    /// # Errors
    /// If `sensors` is empty or names a sensor that is not there.
    pub fn subset(&self, sensors: &[usize]) -> Result<Self, Error> {
        Self::new(self.prior.clone(), self.noise.subset(sensors)?)
    }

    pub(crate) fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Mean of sensor `n`'s sample at each node, and its standard deviation there.
    pub(crate) fn sample_law(&self, n: usize) -> (Vec<f64>, f64) {
        let (loading, deviation) = if self.noise.is_independent() {
            (0.0, self.noise.deviation(n))
        } else {
            (self.noise.loadings[n], self.noise.residuals[n])
        };
        (
            self.nodes
                .iter()
                .map(|node| node.base + loading * node.factor)
                .collect(),
            deviation,
        )
    }

    /// `P(node | x_k)` for every value, for sums over nodes.
    #[doc(hidden)]
    pub fn given(&self) -> &[NodeWeights] {
        &self.given
    }

    /// Whether two sensors have the same noise.
    #[doc(hidden)]
    pub fn interchangeable(&self, m: usize, n: usize) -> bool {
        self.noise.loadings[m] == self.noise.loadings[n] && self.noise.residuals[m] == self.noise.residuals[n]
    }
}

/// Nodes, and the probability of the nodes given each value.
type Resolved = (Vec<Node>, Vec<NodeWeights>);

/// Nodes of `s = x + a u`. If all loadings `a` are equal, everything depends on `s` only. `None` if they are not, if the
/// prior is discrete, or if two axes need fewer nodes because the shared factor is small.
fn on_one_axis(
    prior: &Prior,
    noise: &Noise,
    values: &[f64],
    crowd: f64,
    resolution: Resolution,
) -> Result<Option<Resolved>, Error> {
    let shared = noise.loadings[0];
    let residual = noise.residuals.iter().copied().fold(f64::INFINITY, f64::min);
    let step = resolution.step * f64::min(PRODUCT_STEP * residual / crowd, 0.5 * shared.abs());
    let reach = resolution.reach * FACTOR_REACH * shared.abs();
    let (mean, (low, high)) = (prior.mean(), prior.support(resolution));
    let half_width = (mean - low).max(high - mean) + reach;
    let two_axes = values.len() as f64 * 4.0 * FACTOR_REACH;
    let unequal = noise.loadings.iter().any(|a| *a != shared);
    if unequal || prior.points().is_some() || 2.0 * half_width / step > two_axes {
        return Ok(None);
    }
    let offsets = grid(half_width, step)?;
    let given = values.iter().map(|x| {
        // Relative to the mean, so that an offset costs no digits.
        let x = x - mean;
        let start = offsets.partition_point(|s| *s < x - reach);
        let end = offsets.partition_point(|s| *s <= x + reach);
        let weights = offsets[start..end].iter().map(|s| normal::pdf((s - x) / shared));
        NodeWeights {
            start,
            weights: normalised(weights.collect()),
        }
    });
    let given = given.collect();
    let nodes = offsets.iter().map(|s| Node {
        base: mean + s,
        factor: 0.0,
    });
    Ok(Some((nodes.collect(), given)))
}

/// Pairs of a value of the unknown and one of the shared factor.
fn on_two_axes(noise: &Noise, values: &[f64], crowd: f64, resolution: Resolution) -> Result<Resolved, Error> {
    let steepest = (0..noise.sensors())
        .map(|n| noise.residuals[n] / noise.loadings[n].abs())
        .fold(f64::INFINITY, f64::min);
    let step = resolution.step * f64::min(2.0 * PRIOR_STEP, PRODUCT_STEP * steepest / crowd);
    let factors = grid(resolution.reach * FACTOR_REACH, step)?;
    let weights = normalised(factors.iter().map(|u| normal::pdf(*u)).collect());
    let count = factors.len();
    if values.len().saturating_mul(count) > NODE_LIMIT {
        return too_fine((values.len() * count) as f64);
    }
    let pairs = values
        .iter()
        .flat_map(|x| factors.iter().map(|u| Node { base: *x, factor: *u }));
    let given = (0..values.len()).map(|k| NodeWeights {
        start: k * count,
        weights: weights.clone(),
    });
    Ok((pairs.collect(), given.collect()))
}

fn normalised(mut weights: Vec<f64>) -> Vec<f64> {
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_faint_correlation_takes_few_nodes() {
        let prior = || Prior::normal(0.0, 1.0).unwrap();
        let none = ObservationModel::new(prior(), Noise::independent_with_deviations(&[1.0; 2]).unwrap()).unwrap();
        for rho in [1e-16, 1e-10, 1e-6, 1e-3] {
            let model =
                ObservationModel::new(prior(), Noise::equicorrelated_with_deviations(&[1.0; 2], rho).unwrap()).unwrap();
            assert!(model.nodes() < 40 * none.nodes());
            assert!((model.mass.weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn stored_models_are_checked_when_restored() {
        let model = ObservationModel::new(
            Prior::binary(1.0, 0.3).unwrap(),
            Noise::equicorrelated_with_deviations(&[1.0; 2], 0.4).unwrap(),
        )
        .unwrap();
        let json = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<ObservationModel>(&json).unwrap(), model);
        assert!(serde_json::from_str::<Prior>(r#"{"gaussian":{"deviation":-1}}"#).is_err());
        assert!(serde_json::from_str::<Noise>(r#"{"loadings":[0],"residual_deviations":[0]}"#).is_err());
    }

    #[test]
    fn weights_are_a_probability_and_have_the_right_variance() {
        for noise in [
            Noise::independent_with_deviations(&[0.3, 1.0]).unwrap(),
            Noise::equicorrelated_with_deviations(&[1.0, 1.0], 0.85).unwrap(),
            Noise::equicorrelated_with_deviations(&[1.0, 0.5], -0.4).unwrap(),
        ] {
            let model = ObservationModel::new(Prior::normal(0.0, 2.0).unwrap(), noise).unwrap();
            assert!((model.mass.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!((model.variance - 4.0).abs() < 1e-12);
            assert!(model.moment.weights.iter().sum::<f64>().abs() < 1e-12);
        }
    }

    /// The number of nodes, on which the time of a search depends, does not grow as the noise falls.
    #[test]
    fn searches_raise_noise_that_changes_no_design() {
        let model = |prior: &Prior, noise: f64| {
            let noise = Noise::independent_with_deviations(&[noise, 2.0]).unwrap();
            ObservationModel::new(prior.clone(), noise).unwrap()
        };
        let normal = Prior::normal(3.0, 10.0).unwrap();
        let (coarse, fine) = (model(&normal, 0.1), model(&normal, 1e-3));
        assert!(fine.nodes() > 50 * coarse.nodes());
        assert_eq!(fine.searched().unwrap(), coarse);
        assert_eq!(coarse.searched().unwrap(), coarse);
        // A narrow part of a mixture counts, not the distance of the parts.
        let narrow = Prior::mixture(&[(0.5, 0.0, 0.05), (0.5, 10.0, 1.0)]).unwrap();
        let precise = model(&narrow, 1e-3);
        assert_eq!(precise.searched().unwrap(), precise);
        // Between points noise of any size may matter.
        let points = model(&Prior::binary(1.0, 0.5).unwrap(), 1e-3);
        assert_eq!(points.searched().unwrap(), points);
    }
}
