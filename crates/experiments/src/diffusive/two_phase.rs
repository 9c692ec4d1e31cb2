//! Polynomial Gaussians as the paper prints them: for comparison with the Galerkin form of the library.

use crate::Error;
use fewbits_core::Density;
use fewbits_diffusive::Posterior;
use fewbits_diffusive::density::laplace::Peak;
use fewbits_diffusive::density::polynomials::{hermite, multi_indices};
use fewbits_diffusive::density::{Cells, MixtureFit};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Vector2};

/// Points of a local mesh along each axis, over three standard deviations on either side.
const MESH: i32 = 6;
/// Values below this share of the belief's peak count as this: a series may be negative.
const LEAST: f64 = 1e-12;

/// A Gaussian and the coefficients of `sum C_nu He_nu` that multiply it.
struct Term {
    mean: Vector2<f64>,
    precision: Matrix2<f64>,
    /// `sqrt(det W) / 2 pi`.
    height: f64,
    coefficients: Vec<f64>,
}

/// `sum_l lambda_l phi_l sum_nu C_l,nu He_nu`, a plain density.
pub(super) struct TwoPhase {
    indices: Vec<[usize; 2]>,
    terms: Vec<Term>,
    least: f64,
    /// Share of the terms whose peak has no definite curvature.
    pub no_answer: f64,
}

impl TwoPhase {
    /// Fits the belief with so many peaks (those of a Gaussian mixture, climbed) and polynomials of a degree.
    ///
    /// ```text
    /// mean, covariance of a term = peak and inverse Hessian there
    /// phase 1: C_l   = least squares of p on the mesh of term l alone
    /// phase 2: lambda = least squares of p on all meshes together
    /// ```
    ///
    /// Where the print gives no answer (the Hessian is not definite, as on the first ring) a term takes the moments of the
    /// mixture's component.
    pub(super) fn fit(
        posterior: &Posterior,
        log_density: &impl Fn(&Vector2<f64>) -> f64,
        peaks: usize,
        degree: usize,
    ) -> Result<Self, Error> {
        let indices = multi_indices::<2>(degree)?;
        let fit = MixtureFit::new(peaks)?;
        let mixture = posterior.clumps(200).and_then(|c| Ok(c.fit(&fit)?))?;
        let cells = &posterior.cells;
        let scale = log_scale(cells, log_density);
        let density = |x: &Vector2<f64>| (log_density(x) - scale).exp();
        let (mut terms, mut meshes, mut unanswered) = (Vec::new(), Vec::new(), 0);
        for component in mixture.components() {
            let extent = component.covariance().diagonal().map(f64::sqrt);
            let (mean, covariance) = match Peak::climb(log_density, component.mean(), &extent) {
                Ok(peak) => (peak.mode, peak.covariance),
                Err(_) => {
                    unanswered += 1;
                    (*component.mean(), *component.covariance())
                }
            };
            let Some(factor) = Cholesky::new(covariance) else {
                continue;
            };
            let steps = (-MESH..=MESH).flat_map(|i| (-MESH..=MESH).map(move |j| (i, j)));
            let mesh: Vec<Vector2<f64>> = steps
                .map(|(i, j)| mean + factor.l() * Vector2::new(f64::from(i), f64::from(j)) * (3.0 / f64::from(MESH)))
                .collect();
            let precision = factor.inverse();
            let mut term = Term {
                mean,
                precision,
                height: precision.determinant().sqrt() / std::f64::consts::TAU,
                coefficients: Vec::new(),
            };
            let design = rows(&mesh, indices.len(), |x| term.basis(&indices, x))?;
            let values = DVector::from_iterator(mesh.len(), mesh.iter().map(&density));
            term.coefficients = least_squares(&design, &values);
            terms.push(term);
            meshes.extend(mesh);
        }
        let mut own = Self {
            indices,
            no_answer: f64::from(unanswered) / mixture.len() as f64,
            terms,
            least: 0.0,
        };
        let design = rows(&meshes, own.terms.len(), |x| own.terms.iter().map(|t| t.value(&own.indices, x)).collect())?;
        let values = DVector::from_iterator(meshes.len(), meshes.iter().map(&density));
        let shares = least_squares(&design, &values);
        // Every polynomial but the zeroth integrates to zero: the mass is that of the zeroth coefficients.
        let mass: f64 = own
            .terms
            .iter()
            .zip(&shares)
            .map(|(t, share)| share * t.coefficients[0])
            .sum();
        let mass = if mass > 0.0 { mass } else { 1.0 };
        for (term, share) in own.terms.iter_mut().zip(&shares) {
            term.coefficients.iter_mut().for_each(|c| *c *= share / mass);
        }
        let [x, y] = cells.columns();
        let peak = x
            .iter()
            .zip(y)
            .map(|(x, y)| own.value(&Vector2::new(*x, *y)).unwrap_or(0.0));
        own.least = LEAST * peak.fold(f64::MIN_POSITIVE, f64::max);
        Ok(own)
    }

    fn value(&self, x: &Vector2<f64>) -> Result<f64, Error> {
        let values = self.terms.iter().map(|t| t.value(&self.indices, x));
        values.sum()
    }
}

/// The log density, not normalised, that belongs to a normalised density of one.
fn log_scale(cells: &Cells<2>, log_density: &impl Fn(&Vector2<f64>) -> f64) -> f64 {
    let [x, y] = cells.columns();
    let best = (0..cells.len())
        .max_by(|a, b| cells.weights()[*a].total_cmp(&cells.weights()[*b]))
        .unwrap_or(0);
    let at = Vector2::new(x[best], y[best]);
    log_density(&at) - cells.log_density(&at)
}

fn rows(
    points: &[Vector2<f64>],
    columns: usize,
    row: impl Fn(&Vector2<f64>) -> Result<Vec<f64>, Error>,
) -> Result<DMatrix<f64>, Error> {
    let values = points.iter().map(row).collect::<Result<Vec<_>, _>>()?.concat();
    Ok(DMatrix::from_row_slice(points.len(), columns, &values))
}

/// Least squares with columns scaled to one: polynomials of different degrees differ by many orders.
fn least_squares(design: &DMatrix<f64>, values: &DVector<f64>) -> Vec<f64> {
    let scale: Vec<f64> = design.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(design.nrows(), design.ncols(), |i, j| design[(i, j)] / scale[j]);
    match scaled.svd(true, true).solve(values, 1e-10) {
        Ok(solution) => solution.iter().zip(&scale).map(|(c, s)| c / s).collect(),
        Err(_) => vec![0.0; design.ncols()],
    }
}

impl Term {
    /// `phi He_nu` of every index.
    fn basis(&self, indices: &[[usize; 2]], x: &Vector2<f64>) -> Result<Vec<f64>, Error> {
        let gap = x - self.mean;
        let z = self.precision * gap;
        let phi = self.height * (-0.5 * gap.dot(&z)).exp();
        let all = indices.iter().map(|nu| hermite(*nu, &z, &self.precision));
        all.map(|value| Ok(phi * value?)).collect()
    }

    fn value(&self, indices: &[[usize; 2]], x: &Vector2<f64>) -> Result<f64, Error> {
        let basis = self.basis(indices, x)?;
        Ok(basis.iter().zip(&self.coefficients).map(|(b, c)| b * c).sum())
    }
}

impl TwoPhase {
    /// `KL(cells || own)`, nats, by the midpoint rule.
    pub(super) fn divergence_from(&self, cells: &Cells<2>) -> Result<f64, Error> {
        let [x, y] = cells.columns();
        let mut total = 0.0;
        for (i, weight) in cells.weights().iter().enumerate() {
            let at = Vector2::new(x[i], y[i]);
            total += weight * (cells.log_density(&at) - self.value(&at)?.max(self.least).ln());
        }
        Ok(total)
    }
}
