//! Squared sums of Gaussians times polynomials (linear combinations of polynomial Gaussians, LPG).

mod basis;
mod fit;
pub mod polynomials;
mod three_dimensions;

pub use fit::LpgFit;
pub use three_dimensions::Slice;

use basis::{gauss_hermite, hermite_products};
use fewbits_core::columns::{change_each, state_at};
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use fewbits_densities::Component;
use fewbits_diffusive::Error;
use fewbits_numerics::LogSum;
use fewbits_numerics::error::{all_finite, at_least_one, refuse};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use polynomials::{check_degree, multi_indices};
use rand::{Rng, RngExt};

/// A belief `s(x)^2` with `s(x) = sum_l sum_nu c_l,nu sqrt(phi_l(x)) h_nu(u_l)`: Gaussians `phi_l`, whitened coordinates
/// `u_l = L_l^-1 (x - m_l)`, and products `h_nu` of orthonormal Hermite polynomials of total degree up to `k`.
///
/// The space spanned is that of the paper's polynomials `He_nu(z; W)`. The coordinates here are better conditioned, and the square
/// cannot be negative. In the plane one component of degree `k` needs `5 + (k + 1)(k + 2) / 2` numbers: the Gaussian and the
/// coefficients. (The paper's factors `lambda_l` duplicate the scale of the coefficients and are not sent.)
///
/// The coefficients are the Galerkin projection of `sqrt(p)`: `c = G^-1 b` with the Gram matrix `G` of the basis and
/// `b = int basis sqrt(p)`. Where `p` is zero the fit is small, although no points are placed there. The projection also gives the
/// affinity `int s sqrt(p)`, a measure of the quality.
#[derive(Debug, Clone, PartialEq)]
pub struct Lpg<const D: usize> {
    terms: Vec<Term<D>>,
    degree: usize,
    indices: Vec<[usize; D]>,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

/// Terms of the square root this many nats below another do not change a sum of doubles (`exp(-60)` is 9e-27).
const FAINT: f64 = 60.0;
/// Factor of the deviations of the rejection sampler's proposal: the polynomials widen the Gaussians.
const WIDER: f64 = 1.6;
/// Number of trial points for the sampler's bound, and the most draws of one sample.
const TRIALS: usize = 1000;
const MAX_DRAWS: usize = 100_000;

#[derive(Debug, Clone, PartialEq)]
struct Term<const D: usize> {
    gaussian: Component<D>,
    half_log_peak: f64,
    /// Norm of the matrix that whitens coordinates.
    steepness: f64,
    coefficients: Vec<f64>,
}

impl<const D: usize> Lpg<D> {
    /// A belief from its Gaussians and coefficients: one list per Gaussian, in the order of [`multi_indices`]. It is normalised.
    ///
    /// # Errors
    /// If there is no component, `degree` exceeds 20, a list has the wrong length or an entry that is not finite, or the square
    /// integrates to zero.
    pub fn new(gaussians: &[Component<D>], degree: usize, coefficients: &[Vec<f64>]) -> Result<Self, Error> {
        let mut belief = Self::skeleton(gaussians, degree)?;
        let size = belief.indices.len();
        if coefficients.len() != gaussians.len() || coefficients.iter().any(|c| c.len() != size) {
            let expected = format!("{} lists of {size} numbers", gaussians.len());
            return refuse("coefficients", "of other lengths", expected);
        }
        for (term, list) in belief.terms.iter_mut().zip(coefficients) {
            all_finite("coefficients", list)?;
            term.coefficients.clone_from(list);
        }
        belief.settle()?;
        Ok(belief)
    }

    fn skeleton(gaussians: &[Component<D>], degree: usize) -> Result<Self, Error> {
        at_least_one("components", gaussians.len())?;
        check_degree(degree)?;
        let indices = multi_indices::<D>(degree)?;
        let mut terms = Vec::with_capacity(gaussians.len());
        for gaussian in gaussians {
            terms.push(Term {
                gaussian: *gaussian,
                half_log_peak: -0.5 * gaussian.factor().half_log_det - 0.5 * D as f64 * LN_SQRT_2PI,
                steepness: gaussian.factor().whitener.norm(),
                coefficients: vec![0.0; indices.len()],
            });
        }
        Ok(Self {
            terms,
            degree,
            indices,
            mean: SVector::zeros(),
            covariance: SMatrix::zeros(),
        })
    }

    /// The Gaussians.
    pub fn gaussians(&self) -> impl Iterator<Item = &Component<D>> {
        self.terms.iter().map(|term| &term.gaussian)
    }

    /// Coefficients of each Gaussian's polynomials, in the order of [`multi_indices`].
    pub fn coefficients(&self) -> impl Iterator<Item = &[f64]> {
        self.terms.iter().map(|term| term.coefficients.as_slice())
    }

    /// Highest total degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// How many numbers describe the belief: mean, covariance and coefficients of each component, minus one for the normalisation.
    pub fn scalars(&self) -> usize {
        self.terms.len() * (D + D * (D + 1) / 2 + self.indices.len()) - 1
    }

    /// The log density at `x`, and the logarithm of an upper bound within `half_width` of `x` in every coordinate. The bound widens the
    /// Gaussians by the cell and takes absolute values of the polynomials. `scratch` is a buffer.
    pub fn log_density_and_bound(&self, x: &SVector<f64, D>, half_width: f64, scratch: &mut Vec<f64>) -> (f64, f64) {
        scratch.resize(self.indices.len(), 0.0);
        let (mut bound, mut highest) = (LogSum::default(), f64::NEG_INFINITY);
        let (mut largest, mut sum) = (f64::NEG_INFINITY, 0.0);
        for term in &self.terms {
            let u = term.whitened(x);
            // Distance from the centre to a corner of the cell, in whitened coordinates.
            let reach = half_width * (D as f64).sqrt() * term.steepness;
            let length = u.norm();
            let near = (length - reach).max(0.0);
            let peak = term.half_log_peak - 0.25 * near * near;
            let log = term.half_log_peak - 0.25 * length * length;
            if peak < highest - FAINT {
                continue;
            }
            hermite_products(&self.indices, self.degree, &u, scratch);
            let parts = scratch
                .iter()
                .zip(&term.coefficients)
                .map(|(polynomial, c)| polynomial * c);
            let (value, size): (f64, f64) = (parts.clone().sum(), parts.map(f64::abs).sum());
            // In a large cell the polynomials may all be near zero at its centre. The sum of the coefficients' sizes is used instead.
            let size: f64 = if reach > 0.5 {
                size.max(term.coefficients.iter().map(|c| c.abs()).sum())
            } else {
                size
            };
            bound.add(peak + size.ln());
            highest = bound.value();
            // The sum is kept relative to its largest Gaussian, so that it cannot underflow.
            if log > largest {
                sum *= (largest - log).exp();
                largest = log;
            }
            sum += value * (log - largest).exp();
        }
        let size: f64 = sum.abs();
        let density = if size > 0.0 && size.is_finite() {
            2.0 * (largest + size.ln())
        } else {
            f64::NEG_INFINITY
        };
        (density, 2.0 * highest)
    }

    /// Calls `visit(l, m, weight, x, u_l, u_m)` at the nodes of rules that integrate `sqrt(phi_l phi_m)` times polynomials of
    /// degree up to `2 nodes - 1` per axis exactly, for every pair `l <= m` that overlaps.
    fn pairs(
        &self,
        nodes: usize,
        mut visit: impl FnMut(usize, usize, f64, &SVector<f64, D>, &SVector<f64, D>, &SVector<f64, D>),
    ) -> Result<(), Error> {
        let rule = gauss_hermite(nodes);
        for l in 0..self.terms.len() {
            for m in l..self.terms.len() {
                let (a, b) = (&self.terms[l], &self.terms[m]);
                let (wa, wb) = (&a.gaussian.factor().whitener, &b.gaussian.factor().whitener);
                let precision = (wa.tr_mul(wa) + wb.tr_mul(wb)) * 0.5;
                let singular = || refuse("covariance", "singular", "a positive definite matrix");
                let Some(factor) = precision.cholesky() else {
                    return singular();
                };
                let pull = wa.tr_mul(wa) * a.gaussian.mean() + wb.tr_mul(wb) * b.gaussian.mean();
                let mean = factor.solve(&(pull * 0.5));
                let Some(root) = factor.inverse().cholesky() else {
                    return singular();
                };
                let (ua, ub) = (a.whitened(&mean), b.whitened(&mean));
                let half_log_det: f64 = root.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
                // sqrt(phi_l phi_m) = exp(overlap) N(x; mean, covariance)
                let overlap = a.half_log_peak + b.half_log_peak + half_log_det + D as f64 * LN_SQRT_2PI
                    - 0.25 * (ua.norm_squared() + ub.norm_squared());
                if overlap < -FAINT {
                    continue;
                }
                let lower = root.l();
                for i in 0..nodes.pow(D as u32) {
                    let (mut rest, mut weight) = (i, overlap.exp());
                    let g = SVector::<f64, D>::from_fn(|_, _| {
                        let (node, w) = rule[rest % nodes];
                        rest /= nodes;
                        weight *= w;
                        node
                    });
                    let x = mean + lower * g;
                    visit(l, m, weight, &x, &a.whitened(&x), &b.whitened(&x));
                }
            }
        }
        Ok(())
    }

    /// Normalises the coefficients and computes mean and covariance.
    fn settle(&mut self) -> Result<(), Error> {
        let size = self.indices.len();
        let mut values = vec![0.0; size];
        let (mut mass, mut first, mut second) = (0.0, SVector::<f64, D>::zeros(), SMatrix::<f64, D, D>::zeros());
        let origin = *self.terms[0].gaussian.mean();
        self.pairs(self.degree + 2, |l, m, weight, x, ul, um| {
            let mut at = |term: &Term<D>, u| {
                hermite_products(&self.indices, self.degree, u, &mut values);
                values.iter().zip(&term.coefficients).map(|(v, c)| v * c).sum::<f64>()
            };
            let product = at(&self.terms[l], ul) * at(&self.terms[m], um);
            // Each pair of terms is visited once; pairs of different terms count twice.
            let w = weight * product * if l == m { 1.0 } else { 2.0 };
            let d = x - origin;
            mass += w;
            first += d * w;
            second += d * d.transpose() * w;
        })?;
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(Error::Impossible);
        }
        let norm = mass.sqrt();
        for term in &mut self.terms {
            term.coefficients.iter_mut().for_each(|c| *c /= norm);
        }
        let mean = first / mass;
        self.mean = origin + mean;
        self.covariance = second / mass - mean * mean.transpose();
        Ok(())
    }
}

impl<const D: usize> Term<D> {
    #[inline]
    fn whitened(&self, x: &SVector<f64, D>) -> SVector<f64, D> {
        self.gaussian.factor().whitener * (x - self.gaussian.mean())
    }
}

impl<const D: usize> Belief<D> for Lpg<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance
    }

    /// Rejection sampling from a widened mixture of the Gaussians. The bound is three times the largest ratio at 1000 trial points; a
    /// point above the bound is accepted.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let widened = |rng: &mut R| {
            let term = &self.terms[rng.random_range(0..self.terms.len())];
            let g = SVector::<f64, D>::from_fn(|_, _| rng.sample(rand_distr::StandardNormal));
            term.gaussian.mean() + term.gaussian.factor().lower * g * WIDER
        };
        let mut values = Vec::new();
        // Up to a constant, which the bound contains too.
        let log_proposal = |x: &SVector<f64, D>| {
            let parts = self
                .terms
                .iter()
                .map(|term| 2.0 * term.half_log_peak - 0.5 * term.whitened(x).norm_squared() / (WIDER * WIDER));
            parts.collect::<LogSum>().value()
        };
        let mut bound = f64::NEG_INFINITY;
        for _ in 0..TRIALS {
            let x = widened(rng);
            bound = bound.max(self.log_density_and_bound(&x, 0.0, &mut values).0 - log_proposal(&x));
        }
        bound += 3.0_f64.ln();
        change_each(states, |_| {
            let mut x = widened(rng);
            for _ in 0..MAX_DRAWS {
                let ratio = self.log_density_and_bound(&x, 0.0, &mut values).0 - log_proposal(&x) - bound;
                if rng.random::<f64>().ln() < ratio {
                    break;
                }
                x = widened(rng);
            }
            x
        });
    }
}

impl<const D: usize> Density<D> for Lpg<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        self.log_density_and_bound(state, 0.0, &mut Vec::new()).0
    }

    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        if !fewbits_core::columns::lengths_agree(states, logs) {
            return;
        }
        let mut values = Vec::new();
        for (i, log) in logs.iter_mut().enumerate() {
            *log += self.log_density_and_bound(&state_at(states, i), 0.0, &mut values).0;
        }
    }
}
