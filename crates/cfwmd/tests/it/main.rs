//! Censoring and fusion against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod centre;
mod circle;
mod fixtures;
mod fusion;
mod groups;
mod no_feedback;
mod node;
mod schemes;
mod silence;
mod wild;

use fewbits_baselines::cfwmd::likelihood_of_particles;
use fewbits_cfwmd::Error;
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_core::{Evidence, Gaussian, Likelihood, Link, Observation, Observed, Sensing, Tilted};
use nalgebra::{Matrix1, SVector, Vector1};

/// One instant of a network: a Gaussian updated by what was observed of all sensors, and the likelihood that weighs particles.
trait Instant<S, const D: usize, const M: usize> {
    fn fuse(
        &self,
        predicted: &Gaussian<D>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<(Gaussian<D>, Evidence), Error>;

    fn likelihood(
        &self,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<Vec<Observed<S, Censored<M>, M>>, Error>;
}

impl<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize> Instant<S, D, M> for Network<S, D, M> {
    fn fuse(
        &self,
        predicted: &Gaussian<D>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<(Gaussian<D>, Evidence), Error> {
        let (mut belief, all) = (*predicted, observations.iter().copied().map(Some).collect::<Vec<_>>());
        let found = self.likelihoods(rules, broadcast, &all)?.condition(&mut belief)?;
        Ok((belief, found))
    }

    fn likelihood(
        &self,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        observations: &[Observation<SVector<f64, M>>],
    ) -> Result<Vec<Observed<S, Censored<M>, M>>, Error> {
        likelihood_of_particles(self, rules, broadcast, observations)
    }
}

/// `count` identical silent scalar sensors: innovation within `half_width` of `centre`, noise variance, loss of the link.
#[derive(Debug, Clone, Copy)]
struct Silence {
    centre: f64,
    half_width: f64,
    noise_variance: f64,
    loss: f64,
    count: usize,
}

impl Silence {
    fn factor(&self) -> Censored<1> {
        let rule = if self.half_width > 0.0 {
            CensoringRule::scalar(self.half_width * self.half_width, 1.0).unwrap()
        } else {
            CensoringRule::scalar(1.0, 0.0).unwrap()
        };
        let (centre, noise) = (Vector1::new(self.centre), Matrix1::new(self.noise_variance));
        Censored::missing(
            &rule,
            &centre,
            &noise,
            &Link::lossy(self.loss).unwrap(),
            MissingReports {
                nothing: self.count,
                lost: 0,
            },
        )
        .unwrap()
    }

    fn moments(&self, mean: f64, variance: f64) -> Result<Tilted<1>, Error> {
        fewbits_core::Factor::tilted(&self.factor(), &Gaussian::scalar(mean, variance).unwrap())
    }
}
