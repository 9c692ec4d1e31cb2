//! Gaussian beliefs, updated by a few weighted draws from a proposal that depends on the observations.

use crate::pf_mpa::linearised::Linearised;
use crate::pf_mpa::target::Manoeuvres;
use crate::pf_mpa::tracker::{GaussianTracker, Ranged, Step, StepInfo};
use fewbits_core::columns::set_state;
use fewbits_core::{Gaussian, Likelihood};
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels;
use fewbits_numerics::linalg::symmetrised;
use fewbits_pf_mpa::Error;
use nalgebra::{Matrix2, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// The proposal's covariance divided by that of Gaussian message passing.
const INFLATION: f64 = 1.5;
/// Below this effective sample size the draws do not determine a covariance.
const MIN_EFFECTIVE_SIZE: f64 = 2.5;

/// A Gaussian particle filter whose proposal depends on the observations.
///
/// ```text
/// predicted N(m, P);  proposal q: the Gaussian message-passing posterior of the position, covariance x 1.5
/// p_i ~ q;  w_i = N(p_i; m, P) p(observed | p_i) / q(p_i)
/// ESS < 2.5: the message-passing update;  else weighted moments, covariance x ESS / (ESS - 1), velocity by regression
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct GuidedGaussian {
    draws: usize,
}

/// The stored form of [`GuidedGaussian`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    draws: usize,
}

impl TryFrom<Stored> for GuidedGaussian {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        GuidedGaussian::new(parts.draws)
    }
}

/// Buffers that are reused from step to step.
#[derive(Debug, Clone, Default)]
pub struct GuidedWorkspace {
    places: [Vec<f64>; 2],
    logs: Vec<f64>,
    weights: Vec<f64>,
}

impl GuidedGaussian {
    /// A filter with `draws` draws per step.
    ///
    /// # Errors
    /// If `draws` is below 2.
    pub fn new(draws: usize) -> Result<Self, Error> {
        if draws < 2 {
            return refuse("draws", draws, "at least 2, for a covariance");
        }
        Ok(Self { draws })
    }

    /// The belief from weighted draws of the position; `None` if their effective sample size is too small.
    fn update<R: Rng>(
        &self,
        rng: &mut R,
        predicted: &Gaussian<4>,
        guide: &Gaussian<4>,
        observed: &[Ranged],
        workspace: &mut GuidedWorkspace,
    ) -> Result<Option<(Gaussian<4>, StepInfo)>, Error> {
        let prior = position(predicted).factored()?;
        let about = position(guide);
        let proposal = Gaussian::from_trusted_parts(*about.mean(), about.covariance() * INFLATION).factored()?;
        let GuidedWorkspace { places, logs, weights } = workspace;
        for buffer in places.iter_mut().chain([&mut *logs, weights]) {
            buffer.resize(self.draws, 0.0);
        }
        // Importance sampling of the position: draws from a wide Gaussian about the guide, weighed by prior and likelihood.
        for i in 0..self.draws {
            let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let place = proposal.mean() + proposal.lower() * z;
            logs[i] = prior.log_pdf(&place) - proposal.log_pdf(&place);
            set_state(&mut places.each_mut().map(Vec::as_mut_slice), i, &place);
        }
        observed.add_log_likelihoods(places.each_ref().map(Vec::as_slice), logs);
        let peak = kernels::largest(logs);
        if !peak.is_finite() {
            return Ok(None);
        }
        kernels::exp_minus(logs, peak, weights);
        let total = kernels::sum(weights);
        let size = total * total / kernels::dot(weights, weights);
        if size.is_nan() || size < MIN_EFFECTIVE_SIZE {
            return Ok(None);
        }
        // Weighted moments. The factor ESS / (ESS - 1) removes the bias of the covariance.
        weights.iter_mut().for_each(|w| *w /= total);
        let mean = Vector2::new(kernels::dot(weights, &places[0]), kernels::dot(weights, &places[1]));
        let spread = |a: usize, b: usize| {
            kernels::weighted_covariance(weights, (&places[a], mean[a]), (&places[b], mean[b])) * size / (size - 1.0)
        };
        let covariance = Matrix2::new(spread(0, 0), spread(0, 1), spread(0, 1), spread(1, 1));
        let info = StepInfo {
            log_likelihood: Some(peak + (total / self.draws as f64).ln()),
            effective_sample_size: Some(size),
            fallbacks: 0,
        };
        Ok(Some((regressed(predicted, &mean, &covariance)?, info)))
    }
}

/// The marginal belief of the position.
fn position(belief: &Gaussian<4>) -> Gaussian<2> {
    let covariance: Matrix2<f64> = belief.covariance().fixed_view::<2, 2>(0, 0).into();
    Gaussian::from_trusted_parts(Vector2::new(belief.mean()[0], belief.mean()[1]), covariance)
}

/// The belief after the position has become `N(mean, covariance)`. The velocity follows by its regression on the position.
fn regressed(predicted: &Gaussian<4>, mean: &Vector2<f64>, covariance: &Matrix2<f64>) -> Result<Gaussian<4>, Error> {
    let own = position(predicted);
    let factor = own.cholesky()?;
    let cross = predicted.covariance().fixed_view::<2, 4>(0, 0).into_owned();
    let gain = factor.solve(&cross).transpose();
    let kept = predicted.covariance() - gain * cross;
    let covariance = symmetrised(&(kept + gain * covariance * gain.transpose()));
    let mean = predicted.mean() + gain * (mean - own.mean());
    Ok(Gaussian::from_trusted_parts(mean, covariance))
}

impl GaussianTracker for GuidedGaussian {
    type Workspace = GuidedWorkspace;

    fn advance<R: Rng>(
        &self,
        rng: &mut R,
        step: Step<'_>,
        workspace: &mut GuidedWorkspace,
    ) -> Result<(Gaussian<4>, StepInfo), Error> {
        let predicted = step.predicted(Manoeuvres::AsNoise);
        let (guide, guess) = Linearised::MESSAGE_PASSING.update(&predicted, step.observed)?;
        if !guide.is_finite() {
            return Err(Error::Impossible);
        }
        let updated = self.update(rng, &predicted, &guide, step.observed, workspace)?;
        Ok(updated.unwrap_or((guide, StepInfo { fallbacks: 1, ..guess })))
    }
}
