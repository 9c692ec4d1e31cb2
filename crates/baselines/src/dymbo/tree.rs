//! The exact posterior for every bit string, and from it the most that a better estimator could gain from the same bits.
//!
//! For up to 16 steps all strings are enumerated, each with its exact density on a grid. The mean over the strings of the posterior
//! variance is the minimum mean squared error given the bits that the Dymbo filter asked for. The mean squared difference between
//! the Dymbo estimate and the posterior mean is the filter's excess. Their sum is the filter's mean squared error.
//! [`chain`](fewbits_dymbo::chain) computes it independently; the two agree to 13 digits.

use fewbits_core::factor::Levels;
use fewbits_core::{Cell, Gaussian, Link, Observation, Sign};
use fewbits_dymbo::{DymboFilter, Error, ScalarFilter, ScalarPlant};
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid};
use fewbits_numerics::error::{ArgumentError, positive};

/// Averages over all bit strings of one length.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TreeLevel {
    /// Minimum mean squared error given the first message and the bits.
    pub mmse: f64,
    /// Mean squared distance of the Dymbo estimate from the exact posterior mean.
    pub excess: f64,
}

impl TreeLevel {
    /// Mean squared error of the Dymbo filter: [`mmse`](Self::mmse) plus [`excess`](Self::excess).
    pub fn mse(&self) -> f64 {
        self.mmse + self.excess
    }
}

/// Largest length of the bit strings.
const MAX_DEPTH: usize = 16;
/// Half width of the grid in standard deviations of the state.
const REACH: f64 = 9.5;
/// Grid spacing as a share of the smaller noise deviation.
const SPACING: f64 = 0.35;

/// Averages for all bit strings of the lengths `1..=depth` after a first message of the given resolution and no prior. By symmetry only
/// the strings that start with `+1` are computed.
///
/// # Errors
/// If `depth` is outside `1..=16`, the resolution is not positive, or the process noise is zero.
pub fn first_message_tree(plant: &ScalarPlant, resolution: f64, depth: usize) -> Result<Vec<TreeLevel>, Error> {
    let tau = positive("resolution", resolution)?;
    if !(1..=MAX_DEPTH).contains(&depth) {
        return Err(ArgumentError::new("depth", depth, format!("a depth from 1 to {MAX_DEPTH}")).into());
    }
    let sigma = plant.measurement_variance().sqrt();
    let filter = DymboFilter::new(*plant);
    let start = Gaussian::scalar(0.0, plant.measurement_variance() + tau * tau / 12.0)?;

    // The grid must hold the state for all bits: rare strings have their posterior in the far tail of the prior.
    let widest = super::widest_variance(plant, start.covariance()[0], depth)?;
    let half_width = 0.5 * tau + REACH * widest.sqrt();
    let finest = plant.process_variance().sqrt().min(sigma);
    let grid = UniformGrid::symmetric(half_width, SPACING * positive("process_variance", finest)?)?;
    let walk = Walk {
        filter,
        exact: TransitionKernel::new(plant.dynamics(), grid)?,
    };
    let cell = Levels::certain(Cell::new(-0.5 * tau, 0.5 * tau)?, plant.measurement_variance())?;
    let density = PointMass::new(grid, |x| cell.log_probability(x))?;
    let mut levels = vec![TreeLevel::default(); depth];
    walk.descend(&start, &density, 1.0, &mut levels)?;
    Ok(levels)
}

struct Walk {
    filter: DymboFilter,
    exact: TransitionKernel,
}

impl Walk {
    /// Adds the string's two children, of total probability `weight`, and all their descendants to `levels`.
    fn descend(
        &self,
        belief: &Gaussian<1>,
        density: &PointMass,
        weight: f64,
        levels: &mut [TreeLevel],
    ) -> Result<(), Error> {
        let Some((level, deeper)) = levels.split_first_mut() else {
            return Ok(());
        };
        let predicted = self.filter.predict(belief);
        let threshold = predicted.mean()[0];
        let ahead = self.exact.predict(density)?;
        // The posteriors after the first bit are mirror images: compute one and give it the whole probability.
        let first = belief.mean()[0] == 0.0 && weight == 1.0;
        for bit in [Sign::Above, Sign::Below].into_iter().take(if first { 1 } else { 2 }) {
            let mut exact = ahead.clone();
            let r = self.filter.plant().measurement_variance();
            let factor = Levels::sign(bit, threshold, r, &Link::PERFECT)?;
            let log_evidence = exact.update_with(|x| factor.log_probability(x))?;
            let weight = if first { 1.0 } else { weight * log_evidence.exp() };
            let posterior = self.filter.update(&predicted, &Observation::Received(bit))?.0;
            let distance = posterior.mean()[0] - exact.mean();
            level.mmse += weight * exact.variance();
            level.excess += weight * distance * distance;
            self.descend(&posterior, &exact, weight, deeper)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::first_message_tree;
    use fewbits_dymbo::{ScalarPlant, chain};

    #[test]
    fn mmse_and_excess_add_up_to_the_chains_error() {
        for (a, gamma) in [(0.9, 0.5), (-0.6, 2.0), (1.0, 0.1)] {
            let plant = ScalarPlant::new(a, gamma, 1.0).unwrap();
            let levels = first_message_tree(&plant, 1.0, 7).unwrap();
            let exact = chain::first_message_transient(&plant, 1.0, 13.0 / 12.0, 7).unwrap();
            for (level, step) in levels.iter().zip(&exact[1..]) {
                assert!((level.mse() - step.mse).abs() < 1e-12, "{a} {gamma} {}", level.mse() - step.mse);
            }
        }
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        assert!(first_message_tree(&plant, 1.0, 0).is_err() && first_message_tree(&plant, 0.0, 3).is_err());
        assert!(first_message_tree(&ScalarPlant::new(0.9, 0.0, 1.0).unwrap(), 1.0, 3).is_err());
    }
}
