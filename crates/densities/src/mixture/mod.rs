//! Gaussian mixtures with full covariances.

mod component;
mod ellipse;

pub use component::Component;
pub use ellipse::ellipse;

use crate::Error;
use crate::particles::{Particles, systematic};
use fewbits_core::columns::change_each;
use fewbits_core::{Belief, Columns, ColumnsMut, Density, Gaussian};
use fewbits_numerics::LogSum;
use fewbits_numerics::error::{at_least_one, entries, refuse};
use fewbits_numerics::kernels::{scalar, vectorised};
use fewbits_numerics::normal;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// A density `sum_k w_k N(x; m_k, S_k)` over `R^D` with weights that sum to one.
///
/// ```
/// use fewbits_core::Belief;
/// use fewbits_densities::{Component, Mixture};
/// use nalgebra::{Matrix1, Vector1};
/// let lobe = |w, m| Component::new(w, Vector1::new(m), Matrix1::new(0.25));
/// let belief = Mixture::new(vec![lobe(1.0, -1.0)?, lobe(3.0, 1.0)?])?;
/// assert_eq!(belief.mean()[0], 0.5);
/// assert_eq!(belief.covariance()[(0, 0)], 1.0);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>", into = "Stored<D>")]
pub struct Mixture<const D: usize> {
    components: Vec<Component<D>>,
}

/// Number of points that are processed together: their log densities stay in the first-level cache.
const BLOCK: usize = 128;

impl<const D: usize> Mixture<D> {
    /// A mixture of at least one component; the weights are normalised.
    ///
    /// # Errors
    /// If there is no component or the weights sum to zero or to infinity.
    pub fn new(components: Vec<Component<D>>) -> Result<Self, Error> {
        at_least_one("components", components.len())?;
        let total: f64 = components.iter().map(|c| c.weight).sum();
        if !(total > 0.0 && total.is_finite()) {
            return refuse("weights", format!("a sum of {total}"), "a finite sum above 0");
        }
        let mut components = components;
        for c in &mut components {
            c.weight /= total;
        }
        Ok(Self { components })
    }

    /// One Gaussian as a mixture.
    ///
    /// # Errors
    /// If its covariance is singular.
    pub fn single(gaussian: &Gaussian<D>) -> Result<Self, Error> {
        Self::new(vec![Component::new(1.0, *gaussian.mean(), *gaussian.covariance())?])
    }

    /// The components.
    pub fn components(&self) -> &[Component<D>] {
        &self.components
    }

    /// Number of components, at least one.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.components.len()
    }

    /// The Gaussian of the same mean and covariance.
    pub fn moment_matched(&self) -> Gaussian<D> {
        moment_matched(self.components.iter().map(|c| (c.weight, *c.mean(), *c.covariance())))
    }

    /// `ln p(x)`, never NaN for finite `x`; `-inf` only if the squared distance overflows.
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> f64 {
        let kept = self.components.iter().filter(|c| c.weight > 0.0);
        kept.map(|c| c.weight.ln() + c.log_pdf(x)).collect::<LogSum>().value()
    }

    /// Writes `ln p` of every point of `columns` to `out`. Points beyond the length of `out` are ignored.
    pub fn log_pdf_columns(&self, columns: Columns<'_, D>, out: &mut [f64]) {
        if !fewbits_core::columns::lengths_agree(&columns, out) {
            return;
        }
        let kept: Vec<&Component<D>> = self.components.iter().filter(|c| c.weight > 0.0).collect();
        let mut terms = vec![0.0; kept.len() * BLOCK];
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let from = block * BLOCK;
            let columns: [&[f64]; D] = columns.each_ref().map(|c| &c[from..from + out.len()]);
            for (c, row) in kept.iter().zip(terms.chunks_mut(BLOCK)) {
                c.log_terms(&columns, &mut row[..out.len()]);
            }
            log_sum_rows(&terms, out);
        }
    }

    /// One draw.
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> SVector<f64, D> {
        let u: f64 = rng.random();
        let mut cumulative = 0.0;
        let chosen = self.components.iter().find(|c| {
            cumulative += c.weight;
            u < cumulative
        });
        match chosen.or(self.components.last()) {
            Some(c) => c.draw(rng),
            None => SVector::zeros(),
        }
    }

    /// `count` equally weighted draws. Components are selected systematically: component `k` gives `count w_k` draws, rounded up or down.
    ///
    /// # Errors
    /// If `count` is 0.
    pub fn sample_systematic<R: Rng + ?Sized>(&self, rng: &mut R, count: usize) -> Result<Particles<D>, Error> {
        at_least_one("count", count)?;
        let weights: Vec<f64> = self.components.iter().map(Component::weight).collect();
        let mut chosen = systematic(&weights, count, rng.random()).into_iter();
        Particles::from_draws(count, || self.components[chosen.next().unwrap_or(0)].draw(rng))
    }

    /// The density of `matrix x + shift` for `x` with this density.
    ///
    /// # Errors
    /// If the transformed covariance of a component is singular or not finite.
    pub fn affine<const K: usize>(
        &self,
        matrix: &SMatrix<f64, K, D>,
        shift: &SVector<f64, K>,
    ) -> Result<Mixture<K>, Error> {
        let components = self
            .components
            .iter()
            .map(|c| Component::new(c.weight, matrix * c.mean() + shift, matrix * c.covariance() * matrix.transpose()));
        Mixture::new(components.collect::<Result<_, _>>()?)
    }
}

/// The Gaussian with the mean and covariance of a mixture whose parts are given by weight, mean and covariance. The weights must sum to
/// one; covariances may be singular.
pub fn moment_matched<const D: usize>(
    parts: impl Iterator<Item = (f64, SVector<f64, D>, SMatrix<f64, D, D>)> + Clone,
) -> Gaussian<D> {
    let mean: SVector<f64, D> = parts.clone().map(|(weight, mean, _)| mean * weight).sum();
    let covariance = parts.map(|(weight, own, covariance)| {
        let d = own - mean;
        (covariance + d * d.transpose()) * weight
    });
    Gaussian::from_trusted_parts(mean, covariance.sum())
}

/// Writes `ln sum exp` over the rows of `terms` (each [`BLOCK`] long) to `out`, column by column; `-inf` where all rows have `-inf`.
fn log_sum_rows(terms: &[f64], out: &mut [f64]) {
    vectorised(
        #[inline(always)]
        || {
            let n = out.len();
            let mut largest = [f64::MIN; BLOCK];
            let mut total = [0.0; BLOCK];
            // Two passes per column: the largest term, then the sum relative to it.
            for row in terms.chunks_exact(BLOCK) {
                for (l, x) in largest[..n].iter_mut().zip(row) {
                    *l = if *x > *l { *x } else { *l };
                }
            }
            for row in terms.chunks_exact(BLOCK) {
                for ((t, x), l) in total[..n].iter_mut().zip(row).zip(&largest) {
                    *t += scalar::exp(x - l);
                }
            }
            for ((out, t), l) in out.iter_mut().zip(&total).zip(&largest) {
                *out = l + scalar::ln(*t);
            }
        },
    );
}

impl<const D: usize> Belief<D> for Mixture<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.components.iter().map(|c| c.mean() * c.weight).sum()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.moment_matched().covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        change_each(states, |_| self.sample(rng));
    }
}

impl<const D: usize> Density<D> for Mixture<D> {
    crate::own_log_pdf!();
}

impl Mixture<1> {
    /// `P(X <= x)`.
    pub fn cdf(&self, x: f64) -> f64 {
        self.components
            .iter()
            .map(|c| c.weight * normal::cdf((x - c.mean()[0]) / c.factor().lower[(0, 0)]))
            .sum()
    }
}

/// The stored form of [`Mixture`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored<const D: usize> {
    weights: Vec<f64>,
    #[serde(with = "fewbits_numerics::stored")]
    means: Vec<[f64; D]>,
    #[serde(with = "fewbits_numerics::stored")]
    covariances: Vec<[[f64; D]; D]>,
}

impl<const D: usize> From<Mixture<D>> for Stored<D> {
    fn from(mixture: Mixture<D>) -> Self {
        Self {
            weights: mixture.components.iter().map(Component::weight).collect(),
            means: mixture.components.iter().map(|c| (*c.mean()).into()).collect(),
            covariances: mixture.components.iter().map(|c| (*c.covariance()).into()).collect(),
        }
    }
}

impl<const D: usize> TryFrom<Stored<D>> for Mixture<D> {
    type Error = Error;

    fn try_from(
        Stored {
            weights,
            means,
            covariances,
        }: Stored<D>,
    ) -> Result<Self, Error> {
        entries("means", means.len(), weights.len())?;
        entries("covariances", covariances.len(), weights.len())?;
        let parts = weights.iter().zip(means).zip(covariances);
        let components =
            parts.map(|((weight, mean), covariance)| Component::new(*weight, mean.into(), covariance.into()));
        let mut mixture = Mixture::new(components.collect::<Result<_, _>>()?)?;
        // Weights that already sum to one are kept to the last bit.
        if (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 {
            let kept = mixture.components.iter_mut().zip(weights);
            kept.for_each(|(component, weight)| component.weight = weight);
        }
        Ok(mixture)
    }
}
