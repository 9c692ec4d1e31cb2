//! The exact filter of a number on a grid, the reference for approximate filters.

use crate::contract::{Info, StateFilter};
use crate::moving_grid::{self, FINE};
use crate::transition_kernel::{TransitionKernel, moved};
use crate::{Error, Points};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::{PointMass, UniformGrid};
use rand::Rng;

/// The exact filter of a scalar state with any likelihood, on one of two kinds of grid.
///
/// [`new`](Self::new): a fixed grid, for any dynamics that it resolves. The transition density is a [`TransitionKernel`], which is kept while
/// the dynamics stay the same.
///
/// ```text
/// predict:  p(x) <- h sum_y N(x; f(y), Q(y)) p(y)
/// update:   p(x) <- p(x) p(observed | x) / evidence
/// ```
///
/// [`following`](Self::following): a grid that goes with the belief, as wide as it is, and as fine as the likelihood asks; for dynamics that
/// are linear over the width of the belief. For beliefs that are not Gaussian, as after silence has cut them.
///
/// ```text
/// predict:  nodes x <- f(mean) + F (x - mean), then the sum with N(0, Q)
/// update:   p(x) <- p(x) p(observed | x) / evidence, on a finer grid until the posterior is resolved
/// ```
/// If the posterior reaches an end of the grid, it is that of a Gaussian of the belief's moments.
#[derive(Debug, Clone)]
pub struct PointMassFilter(Region);

#[derive(Debug, Clone)]
enum Region {
    Fixed {
        grid: UniformGrid,
        moved: Vec<(f64, f64)>,
        kernel: Option<TransitionKernel>,
    },
    Following,
}

impl PointMassFilter {
    /// The filter on this grid.
    pub fn new(grid: UniformGrid) -> Self {
        Self(Region::Fixed {
            grid,
            moved: Vec::new(),
            kernel: None,
        })
    }

    /// The filter on a grid that follows the belief.
    pub fn following() -> Self {
        Self(Region::Following)
    }
}

impl StateFilter<1> for PointMassFilter {
    type Belief = PointMass;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<1>) -> Result<PointMass, Error> {
        match &self.0 {
            Region::Fixed { grid, .. } => PointMass::normal(*grid, prior.mean()[0], prior.covariance()[0]),
            Region::Following => moving_grid::start(prior, &FINE),
        }
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<1>,
        belief: &mut PointMass,
    ) -> Result<(), Error> {
        match &mut self.0 {
            Region::Fixed {
                grid,
                moved: known,
                kernel,
            } => {
                let next = moved(grid, dynamics);
                let used = match kernel.take().filter(|_| *known == next) {
                    Some(kernel) => kernel,
                    None => TransitionKernel::from_transitions(*grid, &next)?,
                };
                *belief = used.predict(belief)?;
                (*known, *kernel) = (next, Some(used));
            }
            Region::Following => *belief = moving_grid::predicted(belief, dynamics, &FINE)?,
        }
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut PointMass,
        observed: &[&dyn Likelihood<1>],
    ) -> Result<Info, Error> {
        match &self.0 {
            Region::Fixed { .. } => Ok(Info::new(belief.update(observed)?)),
            Region::Following => {
                let (posterior, log_likelihood) = moving_grid::updated(belief, observed, &FINE)?;
                *belief = posterior;
                Ok(Info::new(log_likelihood))
            }
        }
    }

    fn points(&self, belief: &PointMass) -> Option<Points<1>> {
        Some(Points {
            states: [belief.grid().nodes().collect()],
            log_weights: belief.density().iter().map(|p| p.ln()).collect(),
        })
    }
}
