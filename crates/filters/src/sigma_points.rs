//! The unscented and the cubature Kalman filter for any factor, in square-root form.

use crate::Error;
use crate::contract::{Info, StateFilter};
use crate::root_gaussian::RootGaussian;
use fewbits_core::columns::state_at;
use fewbits_core::{Columns, ColumnsMut, Factor, Gaussian, GaussianDynamics, Likelihood, points};
use fewbits_numerics::error::{at_least_one, non_negative};
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// The filter of a Gaussian belief whose models are evaluated at points instead of being linearised.
///
/// ```text
/// points    m +- sqrt(D + kappa) L e_j   with weight 1 / (2 (D + kappa)),  m with weight kappa / (D + kappa)
/// predict   mean of f(points); columns sqrt(w) (f(point) - mean) and those of a root of Q, triangularised
/// update    Likelihood::move_points: regression of the points on h(points), tilted moments of the factor
/// ```
/// `kappa = 0` is the cubature rule, `kappa > 0` the unscented one with `alpha = 1`. Both integrate polynomials of degree three exactly;
/// `kappa = 3 - D` (for `D` up to 3) also meets the fourth moment along each axis. Weights are not negative: with the negative weights of
/// `kappa < 0` and of small `alpha` a covariance is a difference, which may be indefinite.
///
/// **When points are not needed.** A factor's moments are exact ([`fewbits_core::Factor::tilted`]), so for a linear sensor
/// [`MomentFilter`](crate::MomentFilter) gives the same numbers, however few bits a report has. With linear models and values this filter
/// is the square-root Kalman filter. Points help where `f` or `h` curves within the belief's spread. They do not help where one report
/// makes the belief bimodal: only particles and grids do.
///
/// Process noise is averaged over the points. A bearing must not jump by a turn within the points' spread. Likelihoods without a sensing
/// model are conditioned on the moments ([`Likelihood::condition`]), and the points follow.
///
/// Julier and Uhlmann (2004); Arasaratnam and Haykin (2009); van der Merwe and Wan (2001) for the square-root form.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaPointFilter<const D: usize> {
    /// `sqrt(D + kappa)`.
    reach: f64,
    weights: Vec<f64>,
    points: [Vec<f64>; D],
}

impl<const D: usize> SigmaPointFilter<D> {
    /// The cubature Kalman filter: `2 D` points of equal weight.
    ///
    /// # Errors
    /// If the state has no coordinate.
    pub fn cubature() -> Result<Self, Error> {
        Self::unscented(0.0)
    }

    /// The unscented Kalman filter: `2 D` points, and the mean with weight `kappa / (D + kappa)`.
    ///
    /// # Errors
    /// If `kappa` is negative or not finite, or the state has no coordinate.
    pub fn unscented(kappa: f64) -> Result<Self, Error> {
        non_negative("kappa", kappa)?;
        at_least_one("coordinates", D)?;
        let total = D as f64 + kappa;
        let mut weights = vec![0.5 / total; 2 * D];
        if kappa > 0.0 {
            weights.push(kappa / total);
        }
        Ok(Self {
            reach: total.sqrt(),
            points: std::array::from_fn(|_| vec![0.0; weights.len()]),
            weights,
        })
    }

    /// Time update by a model that is evaluated at all points at once and may fail: `change` replaces the points by the means of the next
    /// states, and `noise` is the covariance of the process noise. The belief is unchanged if it fails.
    ///
    /// # Errors
    /// Those of `change`; [`Error::NotANumber`] if a mean is not finite, or if `noise` is not positive semidefinite.
    pub fn predict_by<E: From<Error>>(
        &mut self,
        belief: &mut RootGaussian<D>,
        noise: &SMatrix<f64, D, D>,
        change: impl FnOnce(ColumnsMut<'_, D>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.place(belief);
        change(self.points.each_mut().map(Vec::as_mut_slice))?;
        *belief = self.belief(noise)?;
        Ok(())
    }

    /// Measurement update by a sensing model that is evaluated at all points at once and may fail: `measure` writes the noise-free
    /// measurements of the points, and `factor` makes from their mean and covariance what was observed. The belief is unchanged if it
    /// fails.
    ///
    /// # Errors
    /// Those of `measure` and `factor`, and of [`points::move_measured_points`].
    pub fn update_by<const M: usize, F: Factor<M>, E: From<Error>>(
        &mut self,
        belief: &mut RootGaussian<D>,
        measure: impl FnOnce(&Columns<'_, D>, ColumnsMut<'_, M>) -> Result<(), E>,
        factor: impl FnOnce(&Gaussian<M>) -> Result<F, E>,
    ) -> Result<Info, E> {
        self.place(belief);
        let mut measured: [Vec<f64>; M] = std::array::from_fn(|_| vec![0.0; self.weights.len()]);
        measure(&self.points.each_ref().map(Vec::as_slice), measured.each_mut().map(Vec::as_mut_slice))?;
        let measured = measured.each_ref().map(Vec::as_slice);
        let what = "the predicted measurement (from the sensing model)";
        let predicted = Some(points::moments(&measured, &self.weights)).filter(Gaussian::is_finite);
        let predicted = predicted.ok_or(Error::NotANumber { what })?;
        let factor = factor(&predicted)?;
        let states = self.points.each_mut().map(Vec::as_mut_slice);
        let (log_likelihood, _) = points::move_measured_points(states, &self.weights, &measured, &factor)?;
        *belief = self.belief(&SMatrix::zeros())?;
        Ok(Info::new(log_likelihood))
    }

    /// Sets the points to those of `belief`.
    fn place(&mut self, belief: &RootGaussian<D>) {
        for d in 0..D {
            let (mean, column) = (belief.mean()[d], &mut self.points[d]);
            column.fill(mean);
            for j in 0..D {
                let offset = self.reach * belief.lower()[(d, j)];
                (column[2 * j], column[2 * j + 1]) = (mean + offset, mean - offset);
            }
        }
    }

    /// The belief with the moments of the points and, added, `extra` (the covariance of noise).
    fn belief(&self, extra: &SMatrix<f64, D, D>) -> Result<RootGaussian<D>, Error> {
        let points = self.points.each_ref().map(Vec::as_slice);
        let states = || (0..self.weights.len()).map(|i| state_at(&points, i)).zip(&self.weights);
        // Offsets from one point keep the digits of a mean that is large beside its spread.
        let origin: SVector<f64, D> = state_at(&points, 0);
        let mean = origin + states().map(|(x, w)| (x - origin) * *w).sum::<SVector<f64, D>>();
        let mut belief = RootGaussian::known(mean);
        states().for_each(|(x, w)| belief.add((x - mean) * w.sqrt()));
        belief.add_covariance("process noise", extra)?;
        let what = "the belief (from its points and the models)";
        Some(belief)
            .filter(RootGaussian::is_finite)
            .ok_or(Error::NotANumber { what })
    }
}

impl<const D: usize> StateFilter<D> for SigmaPointFilter<D> {
    type Belief = RootGaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<RootGaussian<D>, Error> {
        RootGaussian::from_gaussian(prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut RootGaussian<D>,
    ) -> Result<(), Error> {
        self.place(belief);
        let mut noise = SMatrix::zeros();
        for (i, weight) in self.weights.iter().enumerate() {
            let from = state_at(&self.points, i);
            noise += dynamics.noise_covariance_at(&from) * *weight;
            let to = dynamics.mean(&from);
            (0..D).for_each(|d| self.points[d][i] = to[d]);
        }
        *belief = self.belief(&noise)?;
        Ok(())
    }

    /// Observations of one instant are processed one after the other, each with points of its own.
    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut RootGaussian<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let (mut next, mut log_likelihood) = (*belief, 0.0);
        for one in observed {
            self.place(&next);
            let points = self.points.each_mut().map(Vec::as_mut_slice);
            log_likelihood += one.move_points(points, &self.weights)?.log_likelihood;
            next = self.belief(&SMatrix::zeros())?;
        }
        *belief = next;
        Ok(Info::new(log_likelihood))
    }
}
