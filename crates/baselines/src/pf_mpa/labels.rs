//! Exact convergence of Gibbs sweeps over the labels of a product of mixtures.

use crate::pf_mpa::product;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::Error;
use nalgebra::DMatrix;

/// The Markov chain of label choices of a product of mixtures under systematic Gibbs sweeps, as a transition matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelChain {
    /// Transition probabilities of one sweep, from row to column.
    transition: DMatrix<f64>,
    start: Vec<f64>,
    target: Vec<f64>,
    means: Vec<Vec<f64>>,
}

/// Largest number of label choices.
const MAX_LABELS: usize = 1000;

impl LabelChain {
    /// The chain of the product of `factors`. The first labels are drawn by the components' weights.
    ///
    /// # Errors
    /// If there is no factor, a weight is zero, or there are more than 1000 choices.
    pub fn new<const D: usize>(factors: &[&Mixture<D>]) -> Result<Self, Error> {
        at_least_one("factors", factors.len())?;
        let sizes: Vec<usize> = factors.iter().map(|f| f.len()).collect();
        let count = sizes
            .iter()
            .try_fold(1_usize, |n, s| n.checked_mul(*s).filter(|n| *n <= MAX_LABELS));
        let positive = factors.iter().all(|f| f.components().iter().all(|c| c.weight() > 0.0));
        let (Some(count), true) = (count, positive) else {
            return refuse(
                "factors",
                format!("{sizes:?} components"),
                format!("positive weights, at most {MAX_LABELS} choices"),
            );
        };
        let exact = product::exact(factors)?.belief;
        let target: Vec<f64> = exact.components().iter().map(Component::weight).collect();
        let means = exact
            .components()
            .iter()
            .map(|c| c.mean().iter().copied().collect())
            .collect();
        // Labels of the first factor vary slowest.
        let stride = |l: usize| sizes[l + 1..].iter().product::<usize>();
        let label = |choice: usize, l: usize| choice / stride(l) % sizes[l];
        let start = (0..count)
            .map(|choice| {
                (0..sizes.len())
                    .map(|l| factors[l].components()[label(choice, l)].weight())
                    .product()
            })
            .collect();
        let mut transition = DMatrix::identity(count, count);
        for (l, size) in sizes.iter().enumerate() {
            let mut update = DMatrix::zeros(count, count);
            for choice in 0..count {
                let others = choice - label(choice, l) * stride(l);
                let total: f64 = (0..*size).map(|b| target[others + b * stride(l)]).sum();
                for b in 0..*size {
                    let to = others + b * stride(l);
                    update[(choice, to)] = target[to] / total;
                }
            }
            transition *= update;
        }
        Ok(Self {
            transition,
            start,
            target,
            means,
        })
    }

    /// Probabilities of the label choices after `sweeps` sweeps.
    pub fn law(&self, sweeps: usize) -> Vec<f64> {
        let mut law = nalgebra::RowDVector::from_row_slice(&self.start);
        for _ in 0..sweeps {
            law = &law * &self.transition;
        }
        law.iter().copied().collect()
    }

    /// Total variation distance between the labels after `sweeps` sweeps and those of the product.
    pub fn total_variation(&self, sweeps: usize) -> f64 {
        0.5 * self
            .law(sweeps)
            .iter()
            .zip(&self.target)
            .map(|(a, b)| (a - b).abs())
            .sum::<f64>()
    }

    /// Mean of a draw after `sweeps` sweeps minus the mean of the product, along each axis. Averaging more draws does not reduce this
    /// bias.
    pub fn bias(&self, sweeps: usize) -> Vec<f64> {
        let law = self.law(sweeps);
        let axes = self.means.first().map_or(0, Vec::len);
        (0..axes)
            .map(|d| {
                law.iter()
                    .zip(&self.target)
                    .zip(&self.means)
                    .map(|((a, b), m)| (a - b) * m[d])
                    .sum()
            })
            .collect()
    }

    /// Second largest modulus of the chain's eigenvalues: after many sweeps, each further sweep multiplies the distance by it.
    pub fn second_eigenvalue(&self) -> f64 {
        let mut moduli: Vec<f64> = self.transition.complex_eigenvalues().iter().map(|e| e.norm()).collect();
        moduli.sort_by(f64::total_cmp);
        moduli.iter().rev().nth(1).copied().unwrap_or(0.0)
    }
}

/// Second moment of the printed ratio weights for components `N(m_j, sigma^2)` of equal weight, if one point is drawn from each
/// component, and if all points are drawn from the first. Equal weights have second moment 1.
pub fn ratio_second_moments(means: &[f64], sigma: f64) -> (f64, f64) {
    let n = means.len() as f64;
    let of = |i: f64| {
        let pairs = means.iter().flat_map(|j| means.iter().map(move |k| (j, k)));
        pairs
            .map(|(j, k)| ((j - i) * (k - i) / (sigma * sigma)).exp())
            .sum::<f64>()
            / (n * n)
    };
    let each = means.iter().map(|m| of(*m)).sum::<f64>() / n;
    (each, means.first().map_or(0.0, |m| of(*m)))
}
