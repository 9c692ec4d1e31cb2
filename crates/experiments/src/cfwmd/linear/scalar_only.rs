//! Schemes that exist for scalar measurements only.

use super::experiment::{Experiment, Track};
use crate::Error;
use fewbits_cfwmd::censored::Censored;
use fewbits_cfwmd::published::trigger::{StochasticTrigger, Triggered};
use fewbits_cfwmd::rule::Weighing;
use fewbits_core::factor::{InCell, Scalar, Value};
use fewbits_core::{Cell, Dynamics, Link, Observation, Observed, Scheme};
use fewbits_densities::GaussianCloud;
use fewbits_filters::{
    CloudWorkspace, ParticleFilter, RaoBlackwellised, Resampling, Schedule, assumed_density, kalman,
};
use nalgebra::{Matrix1, SMatrix, Vector1, Vector2};

impl Experiment<1> {
    pub(super) fn rao_blackwell(&self, track: &mut Track<'_, 1>, count: usize) -> Result<(), Error> {
        let mut rng = track.stream.named("particles").fast_rng();
        let mut cloud = GaussianCloud::agreed(&self.start, count)?;
        let filter = RaoBlackwellised::new(ParticleFilter::new(Resampling::Systematic, Schedule::Below(0.5)));
        let mut workspace = CloudWorkspace::default();
        for k in 0..self.steps {
            filter.predict(&mut rng, &self.dynamics, &mut cloud, &mut workspace)?;
            let broadcast = cloud.means().mean();
            let rules = vec![self.own[k].1.clone(); self.sensors];
            let (observations, sent) = self.observe(k, track.draws, &rules, &broadcast, 0.0);
            let c = rules[0].half_width();
            let silence: Scalar = match Cell::new(broadcast[0] - c, broadcast[0] + c) {
                Ok(cell) => InCell::certain(cell, self.sensor.noise_variance())?.into(),
                Err(_) => Scalar::from(fewbits_core::factor::Constant::new(0.0)?),
            };
            for observation in &observations {
                let factor = match observation {
                    Observation::Received(z) => Value::scalar(z[0], self.sensor.noise_variance())?.into(),
                    _ => silence.clone(),
                };
                let observed = Observed::new(self.sensor, factor);
                filter.update(&mut rng, &mut cloud, &observed, &mut workspace)?;
            }
            track.note(k, &cloud.gaussian(), sent);
        }
        Ok(())
    }

    pub(super) fn trigger(&self, track: &mut Track<'_, 1>, weighing: Weighing) -> Result<(), Error> {
        let mut belief = self.start;
        for k in 0..self.steps {
            belief = kalman::predict(&self.dynamics, &belief);
            let prediction = self.sensor.matrix() * belief.mean();
            let s = match weighing {
                Weighing::OwnFilter => self.own[k].0.innovation_covariance[(0, 0)],
                _ => belief.covariance()[(0, 0)] + self.sensor.noise_variance(),
            };
            let trigger = StochasticTrigger::for_rate(self.budget.rate(), s)?;
            let scheme = Triggered {
                sensing: self.sensor,
                trigger,
            };
            let broadcast = *belief.mean();
            let mut sent = 0;
            for (i, z) in track.draws.measurements[k].iter().enumerate() {
                let sends = track.draws.coins[k][i] < trigger.probability(z[0] - prediction[0]);
                sent += usize::from(sends);
                let observation = sends.then_some(z[0]).into();
                let factor = scheme.factor(&broadcast, &observation, &Link::PERFECT)?;
                belief = assumed_density::update(&belief, self.sensor.matrix(), &factor)?.0;
            }
            track.note(k, &belief, sent);
        }
        Ok(())
    }

    /// Two ways to guess at the sensors' estimates without a joint belief; both for comparison only.
    pub(super) fn heuristic(&self, track: &mut Track<'_, 1>, centred: bool) -> Result<(), Error> {
        let mut belief = self.start;
        let row = self.sensor.direction();
        for k in 0..self.steps {
            belief = kalman::predict(&self.dynamics, &belief);
            let (step, rule) = &self.own[k];
            let s = step.innovation_covariance[(0, 0)];
            // The direction in which silence measures the state, the centre of its interval, and its noise.
            let (direction, centre, noise) = if centred {
                (row, row.dot(belief.mean()), s)
            } else {
                // nu given x has mean h P Sigma^-1 (x - m) and variance h (P - P Sigma^-1 P) h' + r.
                let spread = self.open_loop[k] + SMatrix::identity() * 1e-9;
                let inverse = spread.try_inverse().unwrap_or_else(SMatrix::zeros);
                let direction = inverse * step.predicted * row;
                let variance = row.dot(&(step.predicted * row)) - direction.dot(&(step.predicted * row));
                let prior = self.prior_mean(k);
                (direction, direction.dot(&prior), variance.max(0.0) + self.sensor.noise_variance())
            };
            let mut received = 0;
            let mut silent = 0;
            for observation in &track.draws.no_feedback[k] {
                match observation {
                    Observation::Received(z) => {
                        belief = kalman::update(&self.sensor, &belief, z)?.0;
                        received += 1;
                    }
                    _ => silent += 1,
                }
            }
            if silent > 0 {
                let (centre, noise) = (Vector1::new(centre), Matrix1::new(noise));
                let factor = Censored::silence(rule, &centre, &noise, &Link::PERFECT, silent)?;
                belief = assumed_density::update(&belief, &direction.transpose(), &factor)?.0;
            }
            track.note(k, &belief, received);
        }
        Ok(())
    }

    /// Mean of the state at step `k` without data.
    fn prior_mean(&self, k: usize) -> Vector2<f64> {
        (0..=k).fold(*self.start.mean(), |m, _| self.dynamics.mean(&m))
    }
}
