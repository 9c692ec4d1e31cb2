//! The best series for a belief over cells: the Galerkin projection of the root of its density.

use super::Lpg;
use super::basis::hermite_products;
use crate::Error;
use crate::density::Cells;
use fewbits_core::columns::state_at;
use fewbits_densities::Component;
use fewbits_numerics::error::refuse;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Pivots of the Gram matrix below this mean that its Gaussians are too much alike.
const DEPENDENT: f64 = 1e-6;

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
                hermite_products(&belief.indices, degree, &u, &mut basis);
                for (nu, value) in basis.iter().enumerate() {
                    b[l * size + nu] += factor * value;
                }
            }
        }
        belief.project(&gram, &b)
    }

    /// The belief whose coefficients are the projection `G^-1 b`, normalised.
    pub(super) fn project(mut self, gram: &DMatrix<f64>, b: &DVector<f64>) -> Result<LpgFit<D>, Error> {
        // The basis of each Gaussian is orthonormal: the diagonal is one, and a tiny pivot is rounding.
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
            // Before it was normalised the projection had the norm of its inner product with what was projected.
            affinity: b.dot(&c).sqrt(),
        })
    }

    pub(super) fn gram(&self) -> Result<DMatrix<f64>, Error> {
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
