//! The ensemble Kalman filter for any factor.

use crate::Error;
use crate::contract::{Info, StateFilter};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::Particles;
use fewbits_numerics::error::{at_least_one, refuse};
use nalgebra::SVector;
use rand::Rng;

/// The filter of an ensemble: equally weighted points that move by the dynamics, noise included, and by regression on what was measured.
///
/// ```text
/// predict   x_i ~ p(x' | x_i); deviations from the mean times the inflation
/// update    Likelihood::move_points: x_i += G (y_i' - y_i), where the y_i' have the tilted moments of the factor
/// ```
/// No perturbed observations are drawn: the update moves the ensemble so that its first two moments are exactly those of the
/// assumed-density update of its own mean and covariance (Anderson 2003; with a value, the ensemble square-root filter of Whitaker and
/// Hamill 2002). It needs no Jacobian, keeps the ensemble's shape, and no weight degenerates. It weighs nothing: where a report makes the
/// belief bimodal, particles do better.
///
/// Moments are those of the points, without the correction `N / (N - 1)`. An inflation of `1 + 1/(2 N)` makes up for it; more makes up
/// for sampling error of small ensembles.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleFilter {
    weights: Vec<f64>,
    inflation: f64,
}

impl EnsembleFilter {
    /// The filter of `count` members, without inflation.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(count: usize) -> Result<Self, Error> {
        at_least_one("count", count)?;
        Ok(Self {
            weights: vec![1.0 / count as f64; count],
            inflation: 1.0,
        })
    }

    /// The same filter that multiplies deviations by `inflation` after each time update.
    ///
    /// # Errors
    /// If `inflation` is below 1 or not finite.
    pub fn with_inflation(self, inflation: f64) -> Result<Self, Error> {
        if !(inflation >= 1.0 && inflation.is_finite()) {
            return refuse("inflation", inflation, "a finite number of at least 1");
        }
        Ok(Self { inflation, ..self })
    }
}

impl<const D: usize> StateFilter<D> for EnsembleFilter {
    type Belief = Particles<D>;

    fn start(&mut self, mut rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Particles<D>, Error> {
        Particles::from_belief(&mut rng, prior, self.weights.len())
    }

    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Particles<D>,
    ) -> Result<(), Error> {
        let mut columns = belief.columns().map(<[f64]>::to_vec);
        dynamics.propagate_columns(rng, columns.each_mut().map(Vec::as_mut_slice));
        if self.inflation > 1.0 {
            let count = self.weights.len() as f64;
            let mean = SVector::<f64, D>::from_fn(|d, _| columns[d].iter().sum::<f64>() / count);
            for (d, column) in columns.iter_mut().enumerate() {
                column
                    .iter_mut()
                    .for_each(|x| *x = mean[d] + (*x - mean[d]) * self.inflation);
            }
        }
        *belief = Particles::uniform(columns).map_err(|_| Error::NotANumber { what: "a member" })?;
        Ok(())
    }

    /// Observations of one instant are processed one after the other.
    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Particles<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let evidence = observed.move_points(belief.columns_mut(), &self.weights)?;
        Ok(Info::new(evidence.log_likelihood))
    }
}
