//! Schemes that exist for scalar measurements only.

use super::{Linear, Track, failed};
use crate::error::Error;
use fewbits_cfwmd::assumed_density::{ScalarSilence, hear_scalar_silence};
use fewbits_cfwmd::rule::Weighing;
use fewbits_cfwmd::trigger::StochasticTrigger;
use fewbits_core::likelihood::Heard;
use fewbits_core::message::Cell;
use fewbits_core::{Dynamics, Observation};
use fewbits_filters::{ParticleFilter, RaoBlackwellised, Resampling, Schedule, Workspace, kalman};
use nalgebra::{SMatrix, Vector2};

impl Linear<1> {
    pub(super) fn rao_blackwell(&self, track: &mut Track<'_, 1>, count: usize) -> Result<(), Error> {
        let mut rng = track.stream.named("particles").fast_rng();
        let mut cloud = RaoBlackwellised::new(&self.start, count).map_err(failed)?;
        let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Below(0.5));
        let mut workspace = Workspace::default();
        for k in 0..self.steps {
            cloud
                .predict(&mut rng, &filter, &self.dynamics, &mut workspace)
                .map_err(failed)?;
            let broadcast = cloud.means().mean();
            let rules = vec![self.own[k].1.clone(); self.sensors];
            let (heard, sent) = self.hear(k, track.draws, &rules, &broadcast, 0.0);
            let c = rules[0].half_width();
            for observation in &heard {
                let what = match observation {
                    Observation::Received(z) => Heard::Value(z[0]),
                    _ => Heard::Silence {
                        cell: Cell::new(broadcast[0] - c, broadcast[0] + c)?,
                        loss: 0.0,
                    },
                };
                cloud.update(&mut rng, &self.sensor, &what).map_err(failed)?;
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
            let trigger = StochasticTrigger::for_rate(self.budget.rate(), s).map_err(failed)?;
            let silent = trigger.silent_sensor(&self.sensor).map_err(failed)?;
            let mut sent = 0;
            for (i, z) in track.draws.measurements[k].iter().enumerate() {
                let speaks = track.draws.coins[k][i] < trigger.probability(z[0] - prediction[0]);
                sent += usize::from(speaks);
                let (sensor, value) = if speaks {
                    (&self.sensor, z)
                } else {
                    (&silent, &prediction)
                };
                belief = kalman::update(sensor, &belief, value).map_err(failed)?.0;
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
            for observation in &track.draws.blind[k] {
                match observation {
                    Observation::Received(z) => {
                        belief = kalman::update(&self.sensor, &belief, z).map_err(failed)?.0;
                        received += 1;
                    }
                    _ => silent += 1,
                }
            }
            if silent > 0 {
                let silence = ScalarSilence {
                    centre,
                    half_width: rule.half_width(),
                    noise_variance: noise,
                    loss: 0.0,
                    count: silent,
                };
                belief = hear_scalar_silence(&belief, &direction, &silence).map_err(failed)?.0;
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
