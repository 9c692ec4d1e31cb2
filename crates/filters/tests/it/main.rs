//! Filters against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod backward_simulation;
mod calibration;
mod centre;
mod circle;
mod contract;
mod failure;
mod fit;
mod fit_delays;
mod fit_faults;
mod fit_limits;
mod fit_worlds;
mod hooks;
mod imm;
mod lattice;
mod moving_grid;
mod own_law;
mod particle;
mod rao_blackwell;
mod resample;
mod sigma_points;
mod state_noise;
mod stored;
mod stuck;
mod tangent;
mod unchanged;
mod wild;
mod window;
mod words;

use fewbits_core::Likelihood;
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid};
use fewbits_models::Ar1;

/// The posterior of a scalar state after all observations, and their log likelihood, by the exact filter on a grid. The prior is normal.
fn on_a_grid(dynamics: &Ar1, [mean, variance]: [f64; 2], observed: &[impl Likelihood<1>]) -> (PointMass, f64) {
    let grid = UniformGrid::new(-12.0, 12.0, 0.02).unwrap();
    let filter = TransitionKernel::new(dynamics, grid).unwrap();
    let start = (PointMass::normal(grid, mean, variance).unwrap(), 0.0);
    observed.iter().fold(start, |(belief, evidence), one| {
        let mut next = filter.predict(&belief).unwrap();
        let increment = next.update(one).unwrap();
        (next, evidence + increment)
    })
}
