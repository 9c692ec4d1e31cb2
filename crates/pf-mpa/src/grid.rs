//! The recommended tracker: [`GridFilter`] over the position.

use crate::Error;
use crate::linearised::Linearised;
use crate::target::{Manoeuvres, Target};
use crate::tracker::{Ranged, StepInfo, Tracker};
use fewbits_core::Gaussian;
use fewbits_filters::{GridFilter, GridWorkspace};
use rand::Rng;

impl Tracker for GridFilter {
    type Belief = Gaussian<4>;
    type Workspace = GridWorkspace<2>;

    fn start<R: Rng + ?Sized>(&self, _: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<Gaussian<4>, Error> {
        Ok(*prior)
    }

    fn estimate(&self, belief: &Gaussian<4>) -> Gaussian<4> {
        *belief
    }

    /// Where the posterior underflows or the grid cannot resolve it, the step is that of Gaussian message passing, and says so.
    fn step_in_place<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Gaussian<4>,
        observed: &[Ranged],
        workspace: &mut GridWorkspace<2>,
    ) -> Result<StepInfo, Error> {
        use fewbits_filters::Error::Unresolved;
        let predicted = target.predict(belief, k, Manoeuvres::AsNoise);
        let updated = self
            .update(&predicted, [0, 1], observed, workspace)
            .map_err(Error::from);
        let ((next, log_likelihood), fallbacks) = match updated {
            Ok((next, info)) => ((next, info.log_likelihood), 0),
            Err(Error::Core(fewbits_core::Error::Impossible) | Error::Filter(Unresolved { .. })) => {
                (Linearised::MESSAGE_PASSING.update(&predicted, observed)?, 1)
            }
            Err(error) => return Err(error),
        };
        *belief = next;
        Ok(StepInfo {
            log_likelihood: Some(log_likelihood),
            fallbacks,
            ..StepInfo::default()
        })
    }
}
