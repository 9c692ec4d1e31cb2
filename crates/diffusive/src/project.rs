//! Approximation of the exact posterior by the belief that is sent to the next node.

use crate::belief::{SentBelief, Travelling};
use crate::form::Form;
use crate::posterior::Posterior;
use crate::{Error, RateModel};
use fewbits_densities::Mixture;
use fewbits_mixture_codec::MixtureFit;

/// Number of clumps that a mixture is fitted to.
const CLUMPS: usize = 200;

/// Approximates a posterior by a belief of the given form. `None` for raw records, which are not projected.
///
/// # Errors
/// If the covariance of the posterior is singular.
pub fn project(posterior: &Posterior, form: Form, rate: &RateModel) -> Result<Option<Travelling>, Error> {
    let carried = matches!(rate, RateModel::Joint(_));
    let components = match form {
        Form::Raw => return Ok(None),
        Form::Other(form) => return Ok(Some(form.0.project(posterior, rate, None)?)),
        Form::Gaussian => 1,
        Form::Mixture(components) => components,
    };
    if carried {
        let clumps = posterior.clumps_with_rate(rate.typical(), if components == 1 { 1 } else { CLUMPS })?;
        return Ok(Some(joint(clumps.fit(&MixtureFit::new(components)?)?)));
    }
    if components == 1 {
        return Ok(Some(position(Mixture::single(&posterior.gaussian())?)));
    }
    Ok(Some(position(posterior.clumps(CLUMPS)?.fit(&MixtureFit::new(components)?)?)))
}

fn position(mixture: Mixture<2>) -> Travelling {
    Travelling::Position(SentBelief::Mixture(mixture))
}

fn joint(mixture: Mixture<3>) -> Travelling {
    Travelling::WithRate(SentBelief::Mixture(mixture))
}
