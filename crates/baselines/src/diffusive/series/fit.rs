//! The best series for a belief over cells: the Galerkin projection of the square root of its density.

use super::basis::hermite_products;
use super::{Lpg, Term};
use fewbits_core::columns::state_at;
use fewbits_densities::Component;
use fewbits_diffusive::Error;
use fewbits_diffusive::density::Cells;
use fewbits_numerics::error::refuse;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// If a pivot of the Gram matrix is below this, the Gaussians are nearly linearly dependent.
const DEPENDENT: f64 = 1e-6;

/// Logarithms of the square root below this are negligible.
pub(super) const NEGLIGIBLE: f64 = -80.0;

/// A fit and its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct LpgFit<const D: usize> {
    /// The normalised belief.
    pub belief: Lpg<D>,
    /// `int sqrt(fit p)`, 1 for a perfect fit; the squared Hellinger distance is one minus this.
    pub affinity: f64,
}

impl<const D: usize> Lpg<D> {
    /// The best approximation of a belief over cells in the span of the given Gaussians with polynomials up to `degree`.
    ///
    /// # Errors
    /// If there is no Gaussian, `degree` exceeds 20, or the basis is singular (two equal Gaussians).
    pub fn fit(cells: &Cells<D>, gaussians: &[Component<D>], degree: usize) -> Result<LpgFit<D>, Error> {
        let columns = cells.columns();
        let scale = cells.width().powi(D as i32).sqrt();
        Self::galerkin(gaussians, degree, cells.weights(), |belief, term, i, weight, out| {
            let u = term.whitened(&state_at(&columns, i));
            let log = term.half_log_peak - 0.25 * u.norm_squared();
            if log < NEGLIGIBLE {
                return false;
            }
            let factor = weight.sqrt() * scale * log.exp();
            hermite_products(&belief.indices, degree, &u, out);
            out.iter_mut().for_each(|value| *value *= factor);
            true
        })
    }

    /// The projection of a square root that is a sum of parts, one per weight. `inner` writes the inner products of one part with the
    /// polynomials of one term, or returns false if they are negligible.
    pub(super) fn galerkin(
        gaussians: &[Component<D>],
        degree: usize,
        weights: &[f64],
        mut inner: impl FnMut(&Self, &Term<D>, usize, f64, &mut [f64]) -> bool,
    ) -> Result<LpgFit<D>, Error> {
        let belief = Self::skeleton(gaussians, degree)?;
        // Coefficients solve `G c = b`: `G` has the inner products of the basis, `b` those of the density with it.
        let gram = belief.gram()?;
        let mut b = DVector::zeros(gram.nrows());
        let mut products = vec![0.0; belief.indices.len()];
        for (i, weight) in weights.iter().enumerate() {
            let parts = b.as_mut_slice().chunks_mut(belief.indices.len());
            for (term, part) in belief.terms.iter().zip(parts) {
                if inner(&belief, term, i, *weight, &mut products) {
                    part.iter_mut()
                        .zip(&products)
                        .for_each(|(sum, product)| *sum += product);
                }
            }
        }
        belief.project(&gram, &b)
    }

    /// The belief whose coefficients are the projection `G^-1 b`, normalised.
    fn project(mut self, gram: &DMatrix<f64>, b: &DVector<f64>) -> Result<LpgFit<D>, Error> {
        // The basis of each Gaussian is orthonormal: the diagonal is one, and a tiny pivot is a rounding error.
        let independent = |factor: &Cholesky<f64, Dyn>| factor.l_dirty().diagonal().min() > DEPENDENT;
        let Some(factor) = gram.clone().cholesky().filter(independent) else {
            return refuse("gaussians", "a dependent set", "Gaussians that differ");
        };
        let c = factor.solve(b);
        for (term, own) in self.terms.iter_mut().zip(c.as_slice().chunks(self.indices.len())) {
            term.coefficients.copy_from_slice(own);
        }
        self.settle()?;
        Ok(LpgFit {
            belief: self,
            // Before normalisation, the squared norm of the projection equals its inner product with the root.
            affinity: b.dot(&c).sqrt(),
        })
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
            hermite_products(&self.indices, self.degree, ul, &mut of_l);
            hermite_products(&self.indices, self.degree, um, &mut of_m);
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
}
