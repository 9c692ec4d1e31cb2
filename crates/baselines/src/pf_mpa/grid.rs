//! The recommended tracker: [`GridFilter`] over the position.

use crate::pf_mpa::linearised::Linearised;
use crate::pf_mpa::target::Manoeuvres;
use crate::pf_mpa::tracker::{GaussianTracker, POSITION, Ranged, Step, StepInfo};
use fewbits_core::{Columns, Gaussian, Likelihood};
use fewbits_filters::{GridFilter, StateFilter};
use fewbits_pf_mpa::Error;
use nalgebra::{SVector, Vector2};
use rand::Rng;

/// Ranges as likelihoods of a state that begins with the position.
struct OfPosition<'a>(&'a [Ranged]);

impl Likelihood<4> for OfPosition<'_> {
    fn log_likelihood(&self, state: &SVector<f64, 4>) -> f64 {
        self.0.log_likelihood(&Vector2::new(state[0], state[1]))
    }

    fn add_log_likelihoods(&self, states: Columns<'_, 4>, log_weights: &mut [f64]) {
        self.0.add_log_likelihoods([states[0], states[1]], log_weights);
    }

    fn reads(&self, _: &SVector<f64, 4>, axis: usize) -> bool {
        POSITION.contains(&axis)
    }
}

/// If the posterior underflows or the grid cannot resolve it, the step is that of Gaussian message passing and counts a fallback.
impl GaussianTracker for GridFilter<4, 2> {
    /// The filter with its buffers.
    type Workspace = Option<GridFilter<4, 2>>;

    fn advance<R: Rng>(
        &self,
        rng: &mut R,
        step: Step<'_>,
        workspace: &mut Self::Workspace,
    ) -> Result<(Gaussian<4>, StepInfo), Error> {
        let predicted = step.predicted(Manoeuvres::AsNoise);
        let filter = workspace.get_or_insert_with(|| self.clone());
        let mut next = predicted;
        match filter.update(rng, &mut next, &[&OfPosition(step.observed)]) {
            Ok(info) => Ok((next, StepInfo::of(info.log_likelihood))),
            Err(Error::Impossible | Error::Unresolved { .. }) => {
                let (next, info) = Linearised::MESSAGE_PASSING.update(&predicted, step.observed)?;
                Ok((next, StepInfo { fallbacks: 1, ..info }))
            }
            Err(error) => Err(error),
        }
    }
}
