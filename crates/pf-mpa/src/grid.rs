//! The recommended tracker: [`GridFilter`] over the position.

use crate::Error;
use crate::linearised::Linearised;
use crate::target::{Manoeuvres, Target};
use crate::tracker::{GaussianTracker, POSITION, Ranged, StepInfo};
use fewbits_core::Gaussian;
use fewbits_filters::{GridFilter, GridWorkspace};
use rand::Rng;

/// Where the posterior underflows or the grid cannot resolve it, the step is that of Gaussian message passing, and says so.
impl GaussianTracker for GridFilter {
    type Workspace = GridWorkspace<2>;

    fn advance<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        target: &Target,
        k: usize,
        belief: &Gaussian<4>,
        observed: &[Ranged],
        workspace: &mut GridWorkspace<2>,
    ) -> Result<(Gaussian<4>, StepInfo), Error> {
        use fewbits_filters::Error::Unresolved;
        let predicted = target.predict(belief, k, Manoeuvres::AsNoise);
        let updated = self.update(&predicted, POSITION, observed, workspace);
        match updated.map_err(Error::from) {
            Ok((next, info)) => {
                let log_likelihood = Some(info.log_likelihood);
                Ok((
                    next,
                    StepInfo {
                        log_likelihood,
                        ..StepInfo::default()
                    },
                ))
            }
            Err(Error::Core(fewbits_core::Error::Impossible) | Error::Filter(Unresolved { .. })) => {
                let (next, info) = Linearised::MESSAGE_PASSING.update(&predicted, observed)?;
                Ok((next, StepInfo { fallbacks: 1, ..info }))
            }
            Err(error) => Err(error),
        }
    }
}
