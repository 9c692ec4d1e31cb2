//! A probability for each cell of a partition of the measurement axis.

use super::moments::Feature;
use super::{Factor, Scalar, Tilted};
use crate::columns::{Columns, lengths_agree};
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::error::{ArgumentError, all_finite, positive};
use fewbits_numerics::{kernels, normal};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// `p(observation | m) = sum_i p_i P(m + n in cell i)`, `n ~ N(0, r)`. Examples: a symbol received over any discrete channel, a bit
/// of a binary pattern, a bit that says whether the measurement is in an interval.
///
/// The cells are `[e_{i-1}, e_i)` between increasing edges, the first and the last unbounded; `p_i` is the probability of the
/// observation given that the measurement lies in cell `i`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers", into = "Numbers")]
pub struct Partition {
    edges: Vec<f64>,
    given_cell: Vec<f64>,
    deviation: f64,
    variance: f64,
}

/// The stored form of [`Partition`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    #[serde(with = "fewbits_numerics::stored")]
    edges: Vec<f64>,
    #[serde(with = "fewbits_numerics::stored")]
    given_cell: Vec<f64>,
    #[serde(with = "fewbits_numerics::stored")]
    noise_variance: f64,
}

impl From<Partition> for Numbers {
    fn from(factor: Partition) -> Self {
        Self {
            edges: factor.edges,
            given_cell: factor.given_cell,
            noise_variance: factor.variance,
        }
    }
}

impl TryFrom<Numbers> for Partition {
    type Error = ArgumentError;

    fn try_from(parts: Numbers) -> Result<Self, ArgumentError> {
        Partition::new(parts.edges, parts.given_cell, parts.noise_variance)
    }
}

impl Partition {
    /// The factor with `edges` (measurement units, strictly increasing) and one probability for each of the
    /// `edges.len() + 1` cells.
    ///
    /// # Errors
    /// If an edge is not finite or not above the one before, the number of probabilities is wrong, one is outside `[0, 1]`,
    /// all are zero, or `r` is not positive.
    pub fn new(edges: Vec<f64>, given_cell: Vec<f64>, noise_variance: f64) -> Result<Self, ArgumentError> {
        all_finite("edges", &edges)?;
        if let Some(pair) = edges.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(ArgumentError::new("edges", format!("{} before {}", pair[0], pair[1]), "increasing edges"));
        }
        if given_cell.len() != edges.len() + 1 {
            let text = format!("{} probabilities", given_cell.len());
            return Err(ArgumentError::new("given_cell", text, format!("{}, one per cell", edges.len() + 1)));
        }
        if let Some(bad) = given_cell.iter().find(|p| !(0.0..=1.0).contains(*p)) {
            return Err(ArgumentError::new("given_cell", bad, "probabilities in [0, 1]"));
        }
        if given_cell.iter().all(|p| *p == 0.0) {
            return Err(ArgumentError::new("given_cell", "all zero", "an observation that some cell can cause"));
        }
        Ok(Self {
            edges,
            given_cell,
            deviation: positive("noise_variance", noise_variance)?.sqrt(),
            variance: noise_variance,
        })
    }

    /// The increasing edges between the cells.
    pub fn edges(&self) -> &[f64] {
        &self.edges
    }

    /// `p(observation | measurement in cell i)`.
    pub fn given_cell(&self) -> &[f64] {
        &self.given_cell
    }

    /// Noise variance `r`.
    pub fn noise_variance(&self) -> f64 {
        self.variance
    }

    /// Lower end, upper end and `p_i` of each cell with `p_i > 0`. Neighbours of equal probability are returned as one cell.
    fn parts(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let mut next = 0;
        std::iter::from_fn(move || {
            while next < self.given_cell.len() {
                let first = next;
                let p = self.given_cell[first];
                while next < self.given_cell.len() && self.given_cell[next] == p {
                    next += 1;
                }
                if p > 0.0 {
                    let lower = if first == 0 {
                        f64::NEG_INFINITY
                    } else {
                        self.edges[first - 1]
                    };
                    return Some((lower, self.edges.get(next - 1).copied().unwrap_or(f64::INFINITY), p));
                }
            }
            None
        })
    }

    /// `ln p(observation | m)`.
    pub fn log_probability(&self, m: f64) -> f64 {
        if m.is_nan() {
            return m;
        }
        if m.is_infinite() {
            let outermost = if m > 0.0 {
                self.given_cell.last()
            } else {
                self.given_cell.first()
            };
            return outermost.map_or(f64::NEG_INFINITY, |p| p.ln());
        }
        let standard = |edge: f64| (edge - m) / self.deviation;
        let logs: Vec<f64> = self
            .parts()
            .map(|(lower, upper, p)| p.ln() + normal::log_interval(standard(lower), standard(upper)))
            .collect();
        kernels::log_sum_exp(&logs).min(0.0)
    }
}

/// Number of means that are processed together.
const BLOCK: usize = 256;
/// Probabilities below this have lost digits; the sum is then taken over logarithms.
const MIN_PROBABILITY: f64 = 1e-280;

/// Adds `p P(lower < m + n < upper)` for every mean.
fn add_cell(means: &[f64], lower: f64, upper: f64, scale: f64, p: f64, probabilities: &mut [f64]) {
    use kernels::scalar::{cdf, interval};
    let pairs = probabilities.iter_mut().zip(means);
    if lower == f64::NEG_INFINITY && upper == f64::INFINITY {
        pairs.for_each(|(sum, _)| *sum += p);
    } else if lower == f64::NEG_INFINITY || upper == f64::INFINITY {
        // A cell with one infinite end: a single distribution function, mirrored if the cell is below its edge.
        let (edge, scale) = if upper == f64::INFINITY {
            (lower, scale)
        } else {
            (upper, -scale)
        };
        kernels::vectorised(
            #[inline(always)]
            || {
                for (sum, m) in pairs {
                    *sum += p * cdf((m - edge) * scale);
                }
            },
        );
    } else {
        kernels::vectorised(
            #[inline(always)]
            || {
                for (sum, m) in pairs {
                    *sum += p * interval((lower - m) * scale, (upper - m) * scale);
                }
            },
        );
    }
}

impl Factor<1> for Partition {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.log_probability(m[0])
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        if !lengths_agree(means, log_weights) {
            return;
        }
        let mut probabilities = [0.0; BLOCK];
        for (log_weights, means) in log_weights.chunks_mut(BLOCK).zip(means[0].chunks(BLOCK)) {
            let probabilities = &mut probabilities[..means.len()];
            probabilities.fill(0.0);
            for (lower, upper, p) in self.parts() {
                add_cell(means, lower, upper, 1.0 / self.deviation, p, probabilities);
            }
            kernels::vectorised(
                #[inline(always)]
                || {
                    for (log_weight, p) in log_weights.iter_mut().zip(&*probabilities) {
                        // Where the probability is tiny, the logarithms below replace it.
                        let p = if *p > MIN_PROBABILITY { *p } else { 1.0 };
                        *log_weight += kernels::scalar::ln(if p < 1.0 { p } else { 1.0 });
                    }
                },
            );
            for ((log_weight, m), p) in log_weights.iter_mut().zip(means).zip(&*probabilities) {
                // The whole line has probability one even for a mean of NaN, which must not raise the weight.
                if *p <= MIN_PROBABILITY || p.is_nan() || m.is_nan() {
                    *log_weight += self.log_probability(*m);
                }
            }
        }
    }

    fn as_scalar(&self) -> Option<(Scalar, f64)> {
        Some((self.clone().into(), 0.0))
    }

    /// The posterior is a mixture of those of the single cells, each in closed form.
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let mut cells = Vec::with_capacity(self.given_cell.len());
        for (lower, upper, p) in self.parts() {
            let cell = crate::cell::Cell::new(lower, upper)?;
            match super::InCell::new(cell, self.variance, 0.0, p)?.tilted(prior) {
                Ok(part) => cells.push(part),
                Err(Error::Impossible) => {}
                Err(error) => return Err(error),
            }
        }
        mixture(&cells, prior)
    }
}

/// The mixture of scalar posteriors, each weighted by its evidence.
fn mixture(parts: &[Tilted<1>], prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
    let largest = parts.iter().map(|t| t.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return Err(Error::Impossible);
    }
    let weight = |t: &Tilted<1>| (t.log_evidence - largest).exp();
    let total: f64 = parts.iter().map(weight).sum();
    let origin = prior.mean()[0];
    let shift = parts.iter().map(|t| weight(t) * (t.mean[0] - origin)).sum::<f64>() / total;
    let spread = |t: &Tilted<1>| {
        let d = t.mean[0] - origin - shift;
        weight(t) * (t.covariance[0] + d * d)
    };
    let variance = parts.iter().map(spread).sum::<f64>() / total;
    Tilted::scalar(largest + total.ln(), origin + shift, variance)
}

impl Partition {
    /// Where the likelihood changes: its edges, each as wide as the noise.
    pub(crate) fn features(&self) -> impl Iterator<Item = Feature> + '_ {
        self.edges.iter().map(|edge| Feature {
            location: *edge,
            width: self.deviation,
        })
    }
}
