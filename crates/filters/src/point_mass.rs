//! An exact scalar filter on a grid, the reference for approximate filters.

use crate::contract::{Info, StateFilter};
use crate::transition_kernel::{TransitionKernel, moved};
use crate::{Error, Points};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::{PointMass, UniformGrid};
use rand::Rng;

/// The exact filter of a scalar state with any likelihood, on a fixed grid, for any dynamics that the grid resolves. The transition density
/// is a [`TransitionKernel`], which is kept while the dynamics stay the same.
///
/// ```text
/// predict:  p(x) <- h sum_y N(x; f(y), Q(y)) p(y)
/// update:   p(x) <- p(x) p(observed | x) / evidence
/// ```
#[derive(Debug, Clone)]
pub struct PointMassFilter {
    grid: UniformGrid,
    moved: Vec<(f64, f64)>,
    kernel: Option<TransitionKernel>,
}

impl PointMassFilter {
    /// The filter on this grid.
    pub fn new(grid: UniformGrid) -> Self {
        Self {
            grid,
            moved: Vec::new(),
            kernel: None,
        }
    }
}

impl StateFilter<1> for PointMassFilter {
    type Belief = PointMass;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<1>) -> Result<PointMass, Error> {
        PointMass::normal(self.grid, prior.mean()[0], prior.covariance()[0])
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<1>,
        belief: &mut PointMass,
    ) -> Result<(), Error> {
        let moved = moved(&self.grid, dynamics);
        let kernel = match self.kernel.take().filter(|_| self.moved == moved) {
            Some(kernel) => kernel,
            None => TransitionKernel::resolving(self.grid, &moved)?,
        };
        *belief = kernel.predict(belief)?;
        (self.moved, self.kernel) = (moved, Some(kernel));
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut PointMass,
        observed: &[&dyn Likelihood<1>],
    ) -> Result<Info, Error> {
        Ok(Info::new(belief.update(observed)?))
    }

    fn points(&self, belief: &PointMass) -> Option<Points<1>> {
        Some(Points {
            states: [belief.grid().nodes().collect()],
            log_weights: belief.density().iter().map(|p| p.ln()).collect(),
        })
    }
}
