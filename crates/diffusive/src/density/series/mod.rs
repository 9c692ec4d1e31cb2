//! Linear combinations of polynomial Gaussians.

pub mod polynomials;
mod three_dimensions;

pub use three_dimensions::{Slice, SliceMoments};

use super::{Cells, Error};
use fewbits_core::columns::state_at;
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use fewbits_densities::Component;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, at_least_one};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SMatrix, SVector};
use polynomials::{check_degree, multi_indices};
use rand::{Rng, RngExt};

/// A belief `s(x)^2` with `s(x) = sum_l sum_nu c_l,nu sqrt(phi_l(x)) h_nu(u_l)`: Gaussians `phi_l`, whitened coordinates
/// `u_l = L_l^-1 (x - m_l)`, and products `h_nu` of orthonormal Hermite polynomials of total degree up to `k`.
///
/// The space spanned is that of the paper's polynomials `He_nu(z; W)`, but the coordinates are well conditioned, and the square
/// can never be negative. One component of degree `k` costs `5 + (k + 1)(k + 2) / 2` numbers in the plane: the Gaussian and the
/// coefficients. (The paper's factors `lambda_l` repeat the scale of the coefficients and are not sent.)
///
/// The coefficients are the Galerkin projection of `sqrt(p)`, `c = G^-1 b` with the Gram matrix `G` of the basis and
/// `b = int basis sqrt(p)`: where `p` is zero, so is the fit, without any point having been placed there. Its affinity with `p`,
/// `int s sqrt(p)`, comes for free and says how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Lpg<const D: usize> {
    terms: Vec<Term<D>>,
    degree: usize,
    indices: Vec<[usize; D]>,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

#[derive(Debug, Clone, PartialEq)]
struct Term<const D: usize> {
    gaussian: Component<D>,
    inverse: SMatrix<f64, D, D>,
    half_log_peak: f64,
    /// Norm of the whitener.
    steepness: f64,
    coefficients: Vec<f64>,
}

/// A fit and its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct LpgFit<const D: usize> {
    /// The normalised belief.
    pub belief: Lpg<D>,
    /// `int sqrt(fit p)`, 1 for a perfect fit; the squared Hellinger distance is one minus this.
    pub affinity: f64,
}

impl<const D: usize> Lpg<D> {
    /// A belief from its Gaussians and coefficients, one list for each Gaussian in the order of
    /// [`multi_indices`]; normalised.
    ///
    /// # Errors
    /// If there is no component, `degree` exceeds 20, a list has the wrong length or an entry that is not finite, or the square
    /// integrates to zero.
    pub fn new(gaussians: &[Component<D>], degree: usize, coefficients: &[Vec<f64>]) -> Result<Self, Error> {
        let mut belief = Self::skeleton(gaussians, degree)?;
        let size = belief.indices.len();
        if coefficients.len() != gaussians.len() || coefficients.iter().any(|c| c.len() != size) {
            let expected = format!("{} lists of {size} numbers", gaussians.len());
            return Err(ArgumentError::new("coefficients", "of other lengths", expected).into());
        }
        for (term, list) in belief.terms.iter_mut().zip(coefficients) {
            all_finite("coefficients", list)?;
            term.coefficients.clone_from(list);
        }
        belief.settle()?;
        Ok(belief)
    }

    /// The best approximation of a belief over cells in the span of the given Gaussians with polynomials up to `degree`.
    ///
    /// # Errors
    /// If there is no Gaussian, `degree` exceeds 20, or the basis is singular (two equal Gaussians).
    pub fn fit(cells: &Cells<D>, gaussians: &[Component<D>], degree: usize) -> Result<LpgFit<D>, Error> {
        let belief = Self::skeleton(gaussians, degree)?;
        let gram = belief.gram()?;
        let size = belief.indices.len();
        let mut b = DVector::zeros(gram.nrows());
        let columns = cells.columns();
        let scale = cells.width().powi(D as i32).sqrt();
        let mut basis = vec![0.0; size];
        for (i, weight) in cells.weights().iter().enumerate() {
            let root = weight.sqrt() * scale;
            let x = state_at(&columns, i);
            for (l, term) in belief.terms.iter().enumerate() {
                let u = term.whitened(&x);
                let log = term.half_log_peak - 0.25 * u.norm_squared();
                if log < -80.0 {
                    continue;
                }
                let factor = root * log.exp();
                polynomials(&belief.indices, degree, &u, &mut basis);
                for (nu, value) in basis.iter().enumerate() {
                    b[l * size + nu] += factor * value;
                }
            }
        }
        belief.project(&gram, &b)
    }

    /// The smallest degree up to `highest` whose affinity reaches `1 - tolerance`, or the best found.
    ///
    /// # Errors
    /// As [`Lpg::fit`].
    pub fn fit_within(
        cells: &Cells<D>,
        gaussians: &[Component<D>],
        highest: usize,
        tolerance: f64,
    ) -> Result<LpgFit<D>, Error> {
        let mut best = Self::fit(cells, gaussians, 0)?;
        for degree in 1..=highest {
            if 1.0 - best.affinity < tolerance {
                break;
            }
            best = Self::fit(cells, gaussians, degree)?;
        }
        Ok(best)
    }

    /// The belief whose coefficients are the projection `G^-1 b`, normalised.
    fn project(mut self, gram: &DMatrix<f64>, b: &DVector<f64>) -> Result<LpgFit<D>, Error> {
        // The basis of each Gaussian is orthonormal: the diagonal is one, and a tiny pivot is rounding.
        let independent = |factor: &Cholesky<f64, Dyn>| factor.l_dirty().diagonal().min() > DEPENDENT;
        let Some(factor) = gram.clone().cholesky().filter(independent) else {
            return Err(ArgumentError::new("gaussians", "a dependent set", "Gaussians that differ").into());
        };
        let c = factor.solve(b);
        for (term, own) in self.terms.iter_mut().zip(c.as_slice().chunks(self.indices.len())) {
            term.coefficients.copy_from_slice(own);
        }
        self.settle()?;
        Ok(LpgFit {
            belief: self,
            // Before it was normalised the projection had the norm of its inner product with what was projected.
            affinity: b.dot(&c).sqrt(),
        })
    }

    fn skeleton(gaussians: &[Component<D>], degree: usize) -> Result<Self, Error> {
        at_least_one("components", gaussians.len())?;
        check_degree(degree)?;
        let indices = multi_indices::<D>(degree)?;
        let mut terms = Vec::with_capacity(gaussians.len());
        for gaussian in gaussians {
            let lower = gaussian.cholesky_factor();
            let Some(inverse) = lower.solve_lower_triangular(&SMatrix::identity()) else {
                return Err(ArgumentError::new("covariance", "singular", "a positive definite matrix").into());
            };
            terms.push(Term {
                gaussian: *gaussian,
                inverse,
                half_log_peak: -0.25 * gaussian.log_determinant() - 0.5 * D as f64 * LN_SQRT_2PI,
                steepness: inverse.norm(),
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

    /// How many numbers describe the belief: of each component a mean, a covariance and the coefficients; one less for the norm.
    pub fn scalars(&self) -> usize {
        self.terms.len() * (D + D * (D + 1) / 2 + self.indices.len()) - 1
    }

    /// The log density at `x`, and the logarithm of a bound of it anywhere within `half_width` of `x` in every coordinate:
    /// Gaussians widened by the cell and polynomials by their absolute values. `scratch` is room for the polynomials.
    pub fn log_density_and_bound(&self, x: &SVector<f64, D>, half_width: f64, scratch: &mut Vec<f64>) -> (f64, f64) {
        scratch.resize(self.indices.len(), 0.0);
        let mut bound = f64::NEG_INFINITY;
        let (mut largest, mut sum) = (f64::NEG_INFINITY, 0.0);
        for term in &self.terms {
            let u = term.whitened(x);
            // How far a corner of the cell is in whitened coordinates.
            let reach = half_width * (D as f64).sqrt() * term.steepness;
            let length = u.norm();
            let near = (length - reach).max(0.0);
            let peak = term.half_log_peak - 0.25 * near * near;
            let log = term.half_log_peak - 0.25 * length * length;
            if peak < bound - 60.0 {
                continue;
            }
            polynomials(&self.indices, self.degree, &u, scratch);
            let parts = scratch
                .iter()
                .zip(&term.coefficients)
                .map(|(polynomial, c)| polynomial * c);
            let (value, size): (f64, f64) = (parts.clone().sum(), parts.map(f64::abs).sum());
            let size: f64 = if reach > 0.5 {
                size.max(term.coefficients.iter().map(|c| c.abs()).sum())
            } else {
                size
            };
            bound = log_add(bound, peak + size.ln());
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
        (density, 2.0 * bound)
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
                let precision = (a.inverse.transpose() * a.inverse + b.inverse.transpose() * b.inverse) * 0.5;
                let Some(factor) = precision.cholesky() else {
                    return Err(ArgumentError::new("covariance", "singular", "a positive definite matrix").into());
                };
                let pull =
                    a.inverse.tr_mul(&a.inverse) * a.gaussian.mean() + b.inverse.tr_mul(&b.inverse) * b.gaussian.mean();
                let mean = factor.solve(&(pull * 0.5));
                let covariance = factor.inverse();
                let Some(root) = covariance.cholesky() else {
                    return Err(ArgumentError::new("covariance", "singular", "a positive definite matrix").into());
                };
                let (ua, ub) = (a.whitened(&mean), b.whitened(&mean));
                let half_log_det: f64 = root.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
                // sqrt(phi_l phi_m) = exp(overlap) N(x; mean, covariance)
                let overlap = a.half_log_peak + b.half_log_peak + half_log_det + D as f64 * LN_SQRT_2PI
                    - 0.25 * (ua.norm_squared() + ub.norm_squared());
                if overlap < -60.0 {
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

    fn gram(&self) -> Result<DMatrix<f64>, Error> {
        let size = self.indices.len();
        let mut gram = DMatrix::identity(size * self.terms.len(), size * self.terms.len());
        let (mut of_l, mut of_m) = (vec![0.0; size], vec![0.0; size]);
        self.pairs(self.degree + 1, |l, m, weight, _, ul, um| {
            if l == m {
                // Orthonormal.
                return;
            }
            polynomials(&self.indices, self.degree, ul, &mut of_l);
            polynomials(&self.indices, self.degree, um, &mut of_m);
            for (i, a) in of_l.iter().enumerate() {
                for (j, b) in of_m.iter().enumerate() {
                    let value = weight * a * b;
                    gram[(l * size + i, m * size + j)] += value;
                    gram[(m * size + j, l * size + i)] += value;
                }
            }
        })?;
        Ok(gram)
    }

    /// Normalises, and finds mean and covariance.
    fn settle(&mut self) -> Result<(), Error> {
        let size = self.indices.len();
        let mut values = vec![0.0; size];
        let (mut mass, mut first, mut second) = (0.0, SVector::<f64, D>::zeros(), SMatrix::<f64, D, D>::zeros());
        let origin = *self.terms[0].gaussian.mean();
        self.pairs(self.degree + 2, |l, m, weight, x, ul, um| {
            let mut at = |term: &Term<D>, u| {
                polynomials(&self.indices, self.degree, u, &mut values);
                values.iter().zip(&term.coefficients).map(|(v, c)| v * c).sum::<f64>()
            };
            let product = at(&self.terms[l], ul) * at(&self.terms[m], um);
            let w = weight * product * if l == m { 1.0 } else { 2.0 };
            let d = x - origin;
            mass += w;
            first += d * w;
            second += d * d.transpose() * w;
        })?;
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(fewbits_core::Error::Impossible.into());
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

    /// `s(x)` as sign and logarithm.
    #[inline]
    fn log_root(&self, x: &SVector<f64, D>, values: &mut [f64]) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        let mut sum = 0.0;
        for term in &self.terms {
            let u = term.whitened(x);
            let log = term.half_log_peak - 0.25 * u.norm_squared();
            polynomials(&self.indices, self.degree, &u, values);
            let polynomial: f64 = values.iter().zip(&term.coefficients).map(|(v, c)| v * c).sum();
            if log > largest {
                sum *= (largest - log).exp();
                largest = log;
            }
            sum += polynomial * (log - largest).exp();
        }
        let size = sum.abs();
        if size > 0.0 && size.is_finite() {
            largest + size.ln()
        } else {
            f64::NEG_INFINITY
        }
    }
}

impl<const D: usize> Term<D> {
    #[inline]
    fn whitened(&self, x: &SVector<f64, D>) -> SVector<f64, D> {
        self.inverse * (x - self.gaussian.mean())
    }
}

impl<const D: usize> Belief<D> for Lpg<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.mean
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.covariance
    }

    /// Rejection from a widened mixture of the Gaussians with a bound found on 1000 trial points times three; a point above the
    /// bound is accepted as it is.
    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let count = states.first().map_or(0, |column| column.len());
        let widened = |rng: &mut R| {
            let term = &self.terms[rng.random_range(0..self.terms.len())];
            let g = SVector::<f64, D>::from_fn(|_, _| rng.sample(rand_distr::StandardNormal));
            term.gaussian.mean() + term.gaussian.cholesky_factor() * g * WIDER
        };
        let mut values = vec![0.0; self.indices.len()];
        // Up to a constant, which the bound has too.
        let log_proposal = |x: &SVector<f64, D>| {
            let parts = self
                .terms
                .iter()
                .map(|term| 2.0 * term.half_log_peak - 0.5 * term.whitened(x).norm_squared() / (WIDER * WIDER));
            parts.fold(f64::NEG_INFINITY, log_add)
        };
        let mut bound = f64::NEG_INFINITY;
        for _ in 0..1000 {
            let x = widened(rng);
            bound = bound.max(2.0 * self.log_root(&x, &mut values) - log_proposal(&x));
        }
        bound += 3.0_f64.ln();
        for i in 0..count {
            let mut x = widened(rng);
            for _ in 0..100_000 {
                let ratio = 2.0 * self.log_root(&x, &mut values) - log_proposal(&x) - bound;
                if rng.random::<f64>().ln() < ratio {
                    break;
                }
                x = widened(rng);
            }
            for d in 0..D {
                states[d][i] = x[d];
            }
        }
    }
}

/// Widening of the proposal of the rejection sampler.
const WIDER: f64 = 1.6;
/// Pivots of the Gram matrix below this mean that its Gaussians are too much alike.
const DEPENDENT: f64 = 1e-6;

impl<const D: usize> Density<D> for Lpg<D> {
    fn log_density(&self, state: &SVector<f64, D>) -> f64 {
        2.0 * self.log_root(state, &mut vec![0.0; self.indices.len()])
    }

    fn add_log_densities(&self, states: &Columns<'_, D>, logs: &mut [f64]) {
        let mut values = vec![0.0; self.indices.len()];
        for (i, log) in logs.iter_mut().enumerate() {
            *log += 2.0 * self.log_root(&state_at(states, i), &mut values);
        }
    }
}

fn log_add(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    if high == f64::NEG_INFINITY {
        high
    } else {
        high + (low - high).exp().ln_1p()
    }
}

/// Orthonormal Hermite products `prod_d he_nu_d(u_d) / sqrt(nu_d!)` for every index.
#[inline]
fn polynomials<const D: usize>(indices: &[[usize; D]], degree: usize, u: &SVector<f64, D>, out: &mut [f64]) {
    let mut table = [[0.0; polynomials::HIGHEST_DEGREE + 1]; D];
    for (row, x) in table.iter_mut().zip(u.iter()) {
        row_of_polynomials(*x, &mut row[..=degree]);
    }
    for (value, index) in out.iter_mut().zip(indices) {
        *value = (0..D).map(|d| table[d][index[d]]).product();
    }
}

/// Orthonormal Hermite polynomials `he_n(x) / sqrt(n!)` of increasing degree.
#[inline]
fn row_of_polynomials(x: f64, row: &mut [f64]) {
    for n in 0..row.len() {
        row[n] = match n {
            0 => 1.0,
            1 => x,
            _ => (x * row[n - 1] - ((n - 1) as f64).sqrt() * row[n - 2]) / (n as f64).sqrt(),
        };
    }
}

/// Nodes and weights of the rule for the standard normal weight, by the eigenvalues of the Jacobi matrix.
fn gauss_hermite(nodes: usize) -> Vec<(f64, f64)> {
    let jacobi = DMatrix::from_fn(nodes, nodes, |i, j| {
        if i.abs_diff(j) == 1 {
            (i.max(j) as f64).sqrt()
        } else {
            0.0
        }
    });
    let eigen = jacobi.symmetric_eigen();
    (0..nodes)
        .map(|i| (eigen.eigenvalues[i], eigen.eigenvectors[(0, i)].powi(2)))
        .collect()
}
