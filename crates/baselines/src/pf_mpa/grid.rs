//! The recommended tracker: [`GridFilter`] over the position.

use crate::pf_mpa::linearised::Linearised;
use crate::pf_mpa::target::Manoeuvres;
use crate::pf_mpa::tracker::{GaussianTracker, POSITION, Step, StepInfo};
use fewbits_core::Gaussian;
use fewbits_filters::{GridFilter, GridWorkspace};
use fewbits_pf_mpa::Error;
use rand::Rng;

/// If the posterior underflows or the grid cannot resolve it, the step is that of Gaussian message passing and counts a fallback.
impl GaussianTracker for GridFilter {
    type Workspace = GridWorkspace<2>;

    fn advance<R: Rng>(
        &self,
        _: &mut R,
        step: Step<'_>,
        workspace: &mut GridWorkspace<2>,
    ) -> Result<(Gaussian<4>, StepInfo), Error> {
        let predicted = step.predicted(Manoeuvres::AsNoise);
        let updated = self.update(&predicted, POSITION, step.observed, workspace);
        match updated {
            Ok((next, info)) => Ok((next, StepInfo::of(info.log_likelihood))),
            Err(Error::Impossible | Error::Unresolved { .. }) => {
                let (next, info) = Linearised::MESSAGE_PASSING.update(&predicted, step.observed)?;
                Ok((next, StepInfo { fallbacks: 1, ..info }))
            }
            Err(error) => Err(error),
        }
    }
}
