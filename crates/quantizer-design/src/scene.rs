//! What the sensors look at: a scalar prior and the noise of each sensor, discretised once for all computations.
//!
//! `Y_n = X + a_n U + d_n V_n` with `U` and all `V_n` standard normal: given `X` and the shared factor `U` the sensors are
//! independent. Every joint probability is then a sum of products of one-dimensional cell probabilities with positive
//! weights, which keeps relative accuracy in far cells where differences of bivariate distribution functions lose it.
//!
//! A Gaussian prior is integrated by the trapezoid rule, which converges faster than any power of the step for these
//! integrands; Gauss-Hermite rules need many more nodes once the noise is narrower than the prior. A finite prior is its own
//! rule, and so is any other density given by the nodes and weights of a quadrature rule.

use crate::error::{Error, refuse};
use fewbits_numerics::normal;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Half-width of the Gaussian prior's rule, in standard deviations.
const PRIOR_REACH: f64 = 9.0;
/// Half-width of the shared factor's rule.
const FACTOR_REACH: f64 = 8.5;
/// Largest step in units of the prior's standard deviation.
const PRIOR_STEP: f64 = 0.25;
/// Largest step of the prior's rule in units of the narrowest noise. Folded cells put the zeros of `P(x)`, where `P ln P` is
/// singular, close to the real axis: at 0.4 their information is off by 3e-8 in noise of 0.3, at 0.2 by 3e-12 (measured).
const ENTROPY_STEP: f64 = 0.2;
/// The same for products of cell probabilities of two sensors, which are entire functions; more sensors make them sharper.
const PRODUCT_STEP: f64 = 0.4;
/// Entries of a covariance matrix are compared within this share of its largest one.
const COVARIANCE_TOLERANCE: f64 = 1e-10;
/// Most nodes a rule may take; less noise than this resolves asks for another method.
const NODE_LIMIT: usize = 1 << 20;

/// Prior of the scalar unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredPrior", into = "StoredPrior")]
pub enum Prior {
    /// Normal with mean 0 and the given standard deviation.
    #[non_exhaustive]
    Gaussian {
        /// Standard deviation.
        sd: f64,
    },
    /// Finitely many values, such as the hypotheses of a detection problem.
    #[non_exhaustive]
    Discrete {
        /// The values.
        values: Vec<f64>,
        /// Their probabilities.
        probabilities: Vec<f64>,
    },
}

/// The stored form of a prior.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum StoredPrior {
    Gaussian { deviation: f64 },
    Discrete { values: Vec<f64>, probabilities: Vec<f64> },
}

impl From<Prior> for StoredPrior {
    fn from(prior: Prior) -> Self {
        match prior {
            Prior::Gaussian { sd } => Self::Gaussian { deviation: sd },
            Prior::Discrete { values, probabilities } => Self::Discrete { values, probabilities },
        }
    }
}

impl TryFrom<StoredPrior> for Prior {
    type Error = Error;

    fn try_from(stored: StoredPrior) -> Result<Self, Error> {
        match stored {
            StoredPrior::Gaussian { deviation } => Self::gaussian(deviation),
            StoredPrior::Discrete { values, probabilities } => Self::discrete(values, probabilities),
        }
    }
}

impl Prior {
    /// Normal prior with mean 0.
    ///
    /// # Errors
    /// If `sd` is not a positive number.
    pub fn gaussian(sd: f64) -> Result<Self, Error> {
        Ok(Self::Gaussian {
            sd: fewbits_numerics::error::positive("sd", sd)?,
        })
    }

    /// Finitely many values with probabilities, or the nodes and weights of a quadrature rule for a density.
    ///
    /// # Errors
    /// If the lengths differ, a value is not finite, or the probabilities are negative or do not sum to 1 within 1e-9.
    pub fn discrete(values: Vec<f64>, probabilities: Vec<f64>) -> Result<Self, Error> {
        fewbits_numerics::error::all_finite("values", &values)?;
        fewbits_numerics::error::probabilities("probabilities", &probabilities)?;
        if values.len() != probabilities.len() {
            return refuse("values", format!("{} values", values.len()), format!("{} values", probabilities.len()));
        }
        Ok(Self::Discrete { values, probabilities })
    }

    /// The two hypotheses 0 and `signal`, the latter with probability `probability`.
    ///
    /// # Errors
    /// If `signal` is not finite or `probability` not in `[0, 1]`.
    pub fn binary(signal: f64, probability: f64) -> Result<Self, Error> {
        fewbits_numerics::error::within("probability", probability, 0.0, 1.0)?;
        Self::discrete(vec![0.0, signal], vec![1.0 - probability, probability])
    }

    /// The prior of `factor * X`.
    fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        match self {
            Self::Gaussian { sd } => Self::gaussian(factor * sd),
            Self::Discrete { values, probabilities } => {
                Self::discrete(values.iter().map(|x| factor * x).collect(), probabilities.clone())
            }
        }
    }

    fn mean(&self) -> f64 {
        match self {
            Self::Gaussian { .. } => 0.0,
            Self::Discrete { values, probabilities } => {
                // About the first value, so that an offset shared by all costs no digit.
                let first = values.first().copied().unwrap_or(0.0);
                let total: f64 = probabilities.iter().sum();
                first + values.iter().zip(probabilities).map(|(x, p)| p * (x - first)).sum::<f64>() / total
            }
        }
    }

    fn spread(&self) -> f64 {
        match self {
            Self::Gaussian { sd } => *sd,
            Self::Discrete { values, probabilities } => {
                let mean = self.mean();
                values
                    .iter()
                    .zip(probabilities)
                    .map(|(x, p)| p * (x - mean) * (x - mean))
                    .sum::<f64>()
                    .sqrt()
            }
        }
    }
}

/// Additive normal noise of all sensors: `a_n U + d_n V_n`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredNoise", into = "StoredNoise")]
pub struct Noise {
    loadings: Vec<f64>,
    residuals: Vec<f64>,
}

/// The stored form of the noise.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredNoise {
    loadings: Vec<f64>,
    residual_deviations: Vec<f64>,
}

impl From<Noise> for StoredNoise {
    fn from(noise: Noise) -> Self {
        Self {
            loadings: noise.loadings,
            residual_deviations: noise.residuals,
        }
    }
}

impl TryFrom<StoredNoise> for Noise {
    type Error = Error;

    fn try_from(stored: StoredNoise) -> Result<Self, Error> {
        Self::one_factor(&stored.loadings, &stored.residual_deviations)
    }
}

impl Noise {
    /// Independent noise with the given standard deviations.
    ///
    /// # Errors
    /// If there is no sensor or a standard deviation is not a positive number.
    pub fn independent(sds: &[f64]) -> Result<Self, Error> {
        Self::one_factor(&vec![0.0; sds.len()], sds)
    }

    /// The same correlation between any two sensors; negative only for two.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number, `|rho| >= 1`, or `rho < 0` with three sensors or more.
    pub fn equicorrelated(sds: &[f64], rho: f64) -> Result<Self, Error> {
        if !(rho > -1.0 && rho < 1.0) {
            return refuse("rho", rho, "a correlation inside (-1, 1)");
        }
        if rho < 0.0 && sds.len() > 2 {
            return Err(Error::UnsupportedCorrelation { sensors: sds.len() });
        }
        let (shared, own) = (rho.abs().sqrt(), (1.0 - rho.abs()).sqrt());
        let sign = |n: usize| if n > 0 && rho < 0.0 { -1.0 } else { 1.0 };
        let loadings: Vec<f64> = sds.iter().enumerate().map(|(n, s)| sign(n) * shared * s).collect();
        let residuals: Vec<f64> = sds.iter().map(|s| own * s).collect();
        Self::one_factor(&loadings, &residuals)
    }

    /// A shared standard normal factor with the given loadings, plus independent residuals of the given standard deviations.
    ///
    /// # Errors
    /// If there is no sensor, the lengths differ, a loading is not finite or a residual is not a positive number.
    pub fn one_factor(loadings: &[f64], residuals: &[f64]) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("sensors", residuals.len())?;
        fewbits_numerics::error::all_finite("loadings", loadings)?;
        for s in residuals {
            fewbits_numerics::error::positive("noise standard deviation", *s)?;
        }
        if loadings.len() != residuals.len() {
            return refuse("loadings", format!("{} loadings", loadings.len()), format!("{}", residuals.len()));
        }
        Ok(Self {
            loadings: loadings.to_vec(),
            residuals: residuals.to_vec(),
        })
    }

    /// Noise with the given covariance matrix, if it is diagonal plus one factor (always so for two sensors).
    ///
    /// # Errors
    /// If the matrix is not square, symmetric and finite with positive variances and correlations inside (-1, 1), or
    /// [`Error::UnsupportedCorrelation`] if one factor does not explain it.
    pub fn covariance(matrix: &DMatrix<f64>) -> Result<Self, Error> {
        let n = matrix.nrows();
        if n == 0 || matrix.ncols() != n {
            return refuse("covariance", format!("{n} by {}", matrix.ncols()), "a square matrix");
        }
        fewbits_numerics::error::all_finite("covariance", matrix.as_slice())?;
        for i in 0..n {
            fewbits_numerics::error::positive("variance", matrix[(i, i)])?;
        }
        let sds: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt()).collect();
        // Correlations have no unit: sensors in metres and in nanoseconds are judged alike.
        let matrix = &DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / (sds[i] * sds[j]));
        let tolerance = COVARIANCE_TOLERANCE;
        if (matrix - matrix.transpose()).amax() > tolerance {
            return refuse("covariance", "not symmetric", "a symmetric matrix");
        }
        if n <= 2 {
            let rho = if n == 2 { matrix[(0, 1)] } else { 0.0 };
            return Self::equicorrelated(&sds, rho);
        }
        let mut loadings = shared_factor(matrix, tolerance);
        let unsupported = Err(Error::UnsupportedCorrelation { sensors: n });
        let mut residuals = Vec::with_capacity(n);
        for i in 0..n {
            for j in 0..i {
                if (matrix[(i, j)] - loadings[i] * loadings[j]).abs() > tolerance {
                    return unsupported;
                }
            }
            let left = matrix[(i, i)] - loadings[i] * loadings[i];
            if left <= tolerance {
                return unsupported;
            }
            residuals.push(sds[i] * left.sqrt());
        }
        loadings.iter_mut().zip(&sds).for_each(|(a, s)| *a *= s);
        Self::one_factor(&loadings, &residuals)
    }

    /// Number of sensors.
    pub fn sensors(&self) -> usize {
        self.residuals.len()
    }

    /// Standard deviation of sensor `n`'s noise.
    pub fn sd(&self, n: usize) -> f64 {
        self.loadings[n].hypot(self.residuals[n])
    }

    /// The noise of some of the sensors, in the given order.
    ///
    /// # Errors
    /// If `sensors` is empty or names a sensor that is not there.
    pub fn subset(&self, sensors: &[usize]) -> Result<Self, Error> {
        if let Some(n) = sensors.iter().find(|n| **n >= self.sensors()) {
            return refuse("sensor", n, format!("a number below {}", self.sensors()));
        }
        let pick = |v: &[f64]| -> Vec<f64> { sensors.iter().map(|n| v[*n]).collect() };
        Self::one_factor(&pick(&self.loadings), &pick(&self.residuals))
    }

    /// The noise in units in which it is `factor` times as large.
    fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        let times = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| factor * x).collect() };
        Self::one_factor(&times(&self.loadings), &times(&self.residuals))
    }

    fn is_independent(&self) -> bool {
        self.sensors() == 1 || self.loadings.iter().filter(|a| **a != 0.0).count() < 2
    }
}

/// Loadings that explain the off-diagonal entries if one factor can: from the largest entry and its best third.
fn shared_factor(matrix: &DMatrix<f64>, tolerance: f64) -> Vec<f64> {
    let n = matrix.nrows();
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let size = |i: usize, j: usize| matrix[(i, j)].abs();
    let Some((p, q)) = pairs.max_by(|a, b| size(a.0, a.1).total_cmp(&size(b.0, b.1))) else {
        return vec![0.0; n];
    };
    if size(p, q) <= tolerance {
        return vec![0.0; n];
    }
    let third = (0..n)
        .filter(|r| *r != p && *r != q && size(p, *r).min(size(q, *r)) > tolerance)
        .max_by(|a, b| size(p, *a).min(size(q, *a)).total_cmp(&size(p, *b).min(size(q, *b))));
    let mut loadings = vec![0.0; n];
    match third {
        Some(r) => {
            let square = matrix[(p, q)] * matrix[(p, r)] / matrix[(q, r)];
            let pivot = square.max(0.0).sqrt();
            if pivot > 0.0 {
                for j in 0..n {
                    loadings[j] = matrix[(p, j)] / pivot;
                }
            }
            loadings[p] = pivot;
        }
        None => {
            // Only this pair is correlated: share the factor in proportion to the standard deviations.
            let ratio = (matrix[(p, p)] / matrix[(q, q)]).sqrt().sqrt();
            let root = size(p, q).sqrt();
            (loadings[p], loadings[q]) = (root * ratio, root / ratio * matrix[(p, q)].signum());
        }
    }
    loadings
}

/// A weighted range of nodes: a linear functional of functions on the nodes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Feature {
    pub(crate) start: usize,
    pub(crate) weights: Vec<f64>,
}

/// Prior and noise on their quadrature nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredScene", into = "StoredScene")]
pub struct Scene {
    prior: Prior,
    noise: Noise,
    /// Values of `X` and their probabilities.
    pub(crate) values: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    /// Nodes given which the sensors are independent: sensor `n` has mean `base + loading_n * factor`.
    base: Vec<f64>,
    factor: Vec<f64>,
    /// `P(node | x_k)`.
    pub(crate) given: Vec<Feature>,
    /// Sums over the prior: `sum_k w_k P(node | x_k)` and the same with `w_k (x_k - mean)`.
    pub(crate) mass: Feature,
    pub(crate) moment: Feature,
    /// Prior mean, from which moments are measured, and variance.
    pub(crate) mean: f64,
    pub(crate) variance: f64,
}

/// The stored form of a scene; its nodes are computed again.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredScene {
    prior: Prior,
    noise: Noise,
}

impl From<Scene> for StoredScene {
    fn from(scene: Scene) -> Self {
        Self {
            prior: scene.prior,
            noise: scene.noise,
        }
    }
}

impl TryFrom<StoredScene> for Scene {
    type Error = Error;

    fn try_from(stored: StoredScene) -> Result<Self, Error> {
        Self::new(stored.prior, stored.noise)
    }
}

impl Scene {
    /// Discretises a prior and the noise of all sensors.
    ///
    /// # Errors
    /// If the noise is so much narrower than the prior that more than a million nodes would be needed.
    pub fn new(prior: Prior, noise: Noise) -> Result<Self, Error> {
        let crowd = (noise.sensors().max(2) as f64 / 2.0).sqrt();
        let narrowest = (0..noise.sensors()).map(|n| noise.sd(n)).fold(f64::INFINITY, f64::min);
        let (values, weights) = match &prior {
            Prior::Gaussian { sd } => {
                let step = f64::min(PRIOR_STEP * sd, f64::min(ENTROPY_STEP, PRODUCT_STEP / crowd) * narrowest);
                let values = grid(PRIOR_REACH * sd, step)?;
                let weights = normalised(values.iter().map(|x| normal::pdf(x / sd)).collect());
                (values, weights)
            }
            Prior::Discrete { values, probabilities } => (values.clone(), normalised(probabilities.clone())),
        };
        let mean = prior.mean();
        let mut scene = Self {
            variance: values.iter().zip(&weights).map(|(x, w)| w * (x - mean) * (x - mean)).sum(),
            mean,
            base: values.clone(),
            factor: vec![0.0; values.len()],
            given: (0..values.len())
                .map(|k| Feature {
                    start: k,
                    weights: vec![1.0],
                })
                .collect(),
            mass: Feature {
                start: 0,
                weights: Vec::new(),
            },
            moment: Feature {
                start: 0,
                weights: Vec::new(),
            },
            prior,
            noise,
            values,
            weights,
        };
        if !scene.noise.is_independent() {
            scene.resolve_shared_factor(crowd)?;
        }
        let mut mass = vec![0.0; scene.base.len()];
        let mut moment = mass.clone();
        for ((feature, w), x) in scene.given.iter().zip(&scene.weights).zip(&scene.values) {
            for (i, p) in feature.weights.iter().enumerate() {
                mass[feature.start + i] += w * p;
                moment[feature.start + i] += w * (x - mean) * p;
            }
        }
        scene.mass.weights = mass;
        scene.moment.weights = moment;
        Ok(scene)
    }

    /// A Gaussian prior seen by sensors with independent noise.
    ///
    /// # Errors
    /// As [`Prior::gaussian`], [`Noise::independent`] and [`Scene::new`].
    pub fn gaussian(prior_sd: f64, noise_sds: &[f64]) -> Result<Self, Error> {
        Self::new(Prior::gaussian(prior_sd)?, Noise::independent(noise_sds)?)
    }

    fn resolve_shared_factor(&mut self, crowd: f64) -> Result<(), Error> {
        let noise = &self.noise;
        let shared = noise.loadings[0];
        let residual = noise.residuals.iter().copied().fold(f64::INFINITY, f64::min);
        let equal = noise.loadings.iter().all(|a| *a == shared);
        if let (Prior::Gaussian { sd }, true) = (&self.prior, equal) {
            // Everything depends on s = x + a u alone: one axis of nodes instead of two.
            let step = f64::min(PRODUCT_STEP * residual / crowd, 0.5 * shared.abs());
            let reach = FACTOR_REACH * shared.abs();
            let one_axis = 2.0 * (PRIOR_REACH * sd + reach) / step;
            let two_axes = self.values.len() as f64 * 4.0 * FACTOR_REACH;
            // A faint shared factor blurs less than the nodes of one axis resolve: two axes need fewer.
            if one_axis > two_axes {
                return self.resolve_on_two_axes(crowd);
            }
            self.base = grid(PRIOR_REACH * sd + reach, step)?;
            self.factor = vec![0.0; self.base.len()];
            let base = &self.base;
            let row = |x: &f64| {
                let start = base.partition_point(|s| *s < x - reach);
                let end = base.partition_point(|s| *s <= x + reach);
                let weights = base[start..end].iter().map(|s| normal::pdf((s - x) / shared)).collect();
                Feature {
                    start,
                    weights: normalised(weights),
                }
            };
            self.given = self.values.iter().map(row).collect();
            return Ok(());
        }
        self.resolve_on_two_axes(crowd)
    }

    fn resolve_on_two_axes(&mut self, crowd: f64) -> Result<(), Error> {
        let noise = &self.noise;
        let steepest = (0..noise.sensors())
            .map(|n| noise.residuals[n] / noise.loadings[n].abs())
            .fold(f64::INFINITY, f64::min);
        let factor = grid(FACTOR_REACH, f64::min(2.0 * PRIOR_STEP, PRODUCT_STEP * steepest / crowd))?;
        let weights = normalised(factor.iter().map(|u| normal::pdf(*u)).collect());
        let nodes = factor.len();
        if self.values.len().saturating_mul(nodes) > NODE_LIMIT {
            return too_fine(self.values.len() * nodes);
        }
        self.base = self.values.iter().flat_map(|x| vec![*x; nodes]).collect();
        self.factor = self.values.iter().flat_map(|_| factor.iter().copied()).collect();
        self.given = (0..self.values.len())
            .map(|k| Feature {
                start: k * nodes,
                weights: weights.clone(),
            })
            .collect();
        Ok(())
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

    /// Prior variance.
    pub fn prior_variance(&self) -> f64 {
        let spread = self.prior.spread();
        spread * spread
    }

    /// Standard deviation of sensor `n`'s sample.
    pub fn sample_sd(&self, n: usize) -> f64 {
        self.prior.spread().hypot(self.noise.sd(n))
    }

    /// Mean of every sample: the prior's.
    pub fn sample_mean(&self) -> f64 {
        self.mean
    }

    /// The scene in units in which every number is `factor` times as large.
    ///
    /// # Errors
    /// If `factor` is not a positive number, or a rescaled number is none.
    pub fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        fewbits_numerics::error::positive("factor", factor)?;
        Self::new(self.prior.rescaled(factor)?, self.noise.rescaled(factor)?)
    }

    /// The same prior seen by some of the sensors only.
    ///
    /// # Errors
    /// As [`Noise::subset`].
    pub fn subset(&self, sensors: &[usize]) -> Result<Self, Error> {
        Self::new(self.prior.clone(), self.noise.subset(sensors)?)
    }

    pub(crate) fn is_independent(&self) -> bool {
        self.noise.is_independent()
    }

    pub(crate) fn is_discrete(&self) -> bool {
        matches!(self.prior, Prior::Discrete { .. })
    }

    pub(crate) fn nodes(&self) -> usize {
        self.base.len()
    }

    /// Mean of sensor `n`'s sample at each node, and its standard deviation there.
    pub(crate) fn sample_law(&self, n: usize) -> (Vec<f64>, f64) {
        if self.is_independent() {
            return (self.base.clone(), self.noise.sd(n));
        }
        let loading = self.noise.loadings[n];
        let means = self
            .base
            .iter()
            .zip(&self.factor)
            .map(|(b, u)| b + loading * u)
            .collect();
        (means, self.noise.residuals[n])
    }

    /// Whether two sensors have the same law.
    pub(crate) fn interchangeable(&self, m: usize, n: usize) -> bool {
        self.noise.loadings[m] == self.noise.loadings[n] && self.noise.residuals[m] == self.noise.residuals[n]
    }
}

/// `0, +-step, +-2 step, ...` as far as `reach`.
fn grid(reach: f64, step: f64) -> Result<Vec<f64>, Error> {
    let half = (reach / step).floor();
    if !(half.is_finite() && half < NODE_LIMIT as f64 / 2.0) {
        return too_fine((2.0 * half).min(1e18) as usize);
    }
    let half = half as i64;
    Ok((-half..=half).map(|i| i as f64 * step).collect())
}

fn too_fine<T>(needed: usize) -> Result<T, Error> {
    Err(Error::TooLarge {
        table: "quadrature rule",
        needed: needed as u64,
        limit: NODE_LIMIT as u64,
    })
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
    fn covariances_of_one_factor_are_found() {
        let (a, d) = ([0.5, -0.3, 0.8, 0.0], [0.4, 0.5, 0.6, 0.7]);
        let matrix = DMatrix::from_fn(4, 4, |i, j| a[i] * a[j] + if i == j { d[i] * d[i] } else { 0.0 });
        let noise = Noise::covariance(&matrix).unwrap();
        for i in 0..4 {
            assert!((noise.sd(i) - matrix[(i, i)].sqrt()).abs() < 1e-12);
            for j in 0..i {
                assert!((noise.loadings[i] * noise.loadings[j] - matrix[(i, j)]).abs() < 1e-12);
            }
        }
        let pair = DMatrix::from_row_slice(3, 3, &[1.0, -0.4, 0.0, -0.4, 4.0, 0.0, 0.0, 0.0, 1.0]);
        let noise = Noise::covariance(&pair).unwrap();
        assert!((noise.loadings[0] * noise.loadings[1] + 0.4).abs() < 1e-12);
        assert!(noise.loadings[2] == 0.0);
    }

    #[test]
    fn what_one_factor_cannot_explain_is_refused() {
        let chain = DMatrix::from_row_slice(3, 3, &[1.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0, 0.5, 1.0]);
        assert!(matches!(Noise::covariance(&chain), Err(Error::UnsupportedCorrelation { sensors: 3 })));
        assert!(matches!(Noise::equicorrelated(&[1.0; 3], -0.2), Err(Error::UnsupportedCorrelation { .. })));
        for rho in [1.0, -1.0, f64::NAN] {
            assert!(
                Noise::equicorrelated(&[1.0, 1.0], rho)
                    .unwrap_err()
                    .to_string()
                    .contains("rho")
            );
        }
        assert!(Noise::independent(&[1.0, 0.0]).is_err());
        assert!(Noise::independent(&[]).is_err());
        assert!(Prior::discrete(vec![0.0, 1.0], vec![0.4, 0.4]).is_err());
        assert!(Prior::discrete(vec![0.0], vec![0.4, 0.6]).is_err());
        assert!(Prior::binary(1.0, 1.5).is_err());
        assert!(matches!(Scene::gaussian(1.0, &[1e-9]), Err(Error::TooLarge { .. })));
    }

    #[test]
    fn a_faint_correlation_takes_few_nodes() {
        let prior = || Prior::gaussian(1.0).unwrap();
        let none = Scene::new(prior(), Noise::independent(&[1.0; 2]).unwrap()).unwrap();
        for rho in [1e-16, 1e-10, 1e-6, 1e-3] {
            let scene = Scene::new(prior(), Noise::equicorrelated(&[1.0; 2], rho).unwrap()).unwrap();
            assert!(scene.nodes() < 40 * none.nodes());
            assert!((scene.mass.weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn stored_scenes_are_checked_when_restored() {
        let scene = Scene::new(Prior::binary(1.0, 0.3).unwrap(), Noise::equicorrelated(&[1.0; 2], 0.4).unwrap()).unwrap();
        let json = serde_json::to_string(&scene).unwrap();
        assert_eq!(serde_json::from_str::<Scene>(&json).unwrap(), scene);
        assert!(serde_json::from_str::<Prior>(r#"{"gaussian":{"deviation":-1}}"#).is_err());
        assert!(serde_json::from_str::<Noise>(r#"{"loadings":[0],"residual_deviations":[0]}"#).is_err());
    }

    #[test]
    fn weights_are_a_probability_and_have_the_right_variance() {
        for noise in [
            Noise::independent(&[0.3, 1.0]).unwrap(),
            Noise::equicorrelated(&[1.0, 1.0], 0.85).unwrap(),
            Noise::equicorrelated(&[1.0, 0.5], -0.4).unwrap(),
        ] {
            let scene = Scene::new(Prior::gaussian(2.0).unwrap(), noise).unwrap();
            assert!((scene.mass.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!((scene.variance - 4.0).abs() < 1e-12);
            assert!(scene.moment.weights.iter().sum::<f64>().abs() < 1e-12);
        }
    }
}
