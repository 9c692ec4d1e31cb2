//! The nonlinear experiments: a target in a plane among sensors of received power.

use super::rows::Ensemble;
use super::setting::{Field, Setting};
use super::world::{At, Centre, Draws, Known, Named, World};
use crate::prelude::*;
use fewbits_baselines::cfwmd::likelihood_of_particles;
use fewbits_cfwmd::censored::Censored;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::threshold::Budget;
use fewbits_densities::Particles;
use fewbits_filters::{BootstrapFilter, Resampling, ResamplingRule, Schedule};
use fewbits_models::{LinearGaussian, ReceivedPower, constant_velocity_2d};

/// What is sent, and whether silence is fused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    All,
    Random,
    /// Censored, silence ignored.
    Ignored,
    /// Censored with each sensor's own linearised recursion, silence fused.
    State,
    /// Censored with the particles' covariance, silence fused.
    StateAndCovariance,
}

/// One nonlinear experiment at one budget.
pub(super) struct Plane {
    dynamics: LinearGaussian<4, 2>,
    pub(super) sensors: Vec<ReceivedPower<4>>,
    pub(super) start: Gaussian<4>,
    steps: usize,
    particles: usize,
    drawn_start: bool,
    budget: Budget,
}

impl Plane {
    pub(super) fn new(field: &Field, messages: f64) -> Result<Self, Error> {
        let sensors = (0..9)
            .map(|i| Vector2::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0) * field.spacing_m)
            .map(|place| ReceivedPower::new(place, [0, 2], 1000.0, 1.0, 2.0, field.noise_variance))
            .collect::<Result<Vec<_>, _>>()?;
        let (mean, variances) =
            (Vector4::from_column_slice(&field.start), Vector4::from_column_slice(&field.start_variances));
        Ok(Self {
            dynamics: constant_velocity_2d(0.5, field.acceleration_variance)?,
            budget: Budget::new(messages, sensors.len())?,
            sensors,
            start: Gaussian::new(mean, Matrix4::from_diagonal(&variances))?,
            steps: field.steps as usize,
            particles: field.particles as usize,
            drawn_start: field.drawn_start.unwrap_or(false),
        })
    }

    /// Particles from the prior, whose axes are independent.
    fn cloud<R: Rng + ?Sized>(&self, rng: &mut R) -> Result<Particles<4>, Error> {
        let (mean, deviations) = (self.start.mean(), self.start.standard_deviations());
        let mut draw = || Vector4::from_fn(|d, _| mean[d] + deviations[d] * rng.sample::<f64, _>(StandardNormal));
        Ok(Particles::from_draws(self.particles, &mut draw)?)
    }
}

impl World<4, 1> for Plane {
    type Scheme = Scheme;

    fn draw(&self, stream: Stream) -> Draws<4, 1> {
        Draws::new(&self.dynamics, &self.sensors, &self.start, self.drawn_start, self.steps, stream)
    }

    fn centre<'a>(&'a self, scheme: Scheme, draws: &'a Draws<4, 1>, stream: Stream) -> Result<Centre<'a, 4>, Error> {
        let threshold = self.budget.threshold(1)?;
        let mut rng = stream.named("particles").fast_rng();
        let mut cloud = self.cloud(&mut rng)?;
        let rule = ResamplingRule {
            resampling: Resampling::Systematic,
            schedule: Schedule::Always,
        };
        let mut filter = BootstrapFilter::new(rule, self.particles)?;
        let network = Network::new(self.sensors.clone(), threshold, Link::PERFECT)?;
        let always = CensoringRule::scalar(1.0, 0.0)?;
        let mut own = vec![OwnRecursion::new(&self.start); self.sensors.len()];
        // What the fusion centre fed back last: its estimate and, for the second variant, its covariance.
        let mut fed_back = self.start;
        Ok(Box::new(move |k| {
            let expected = self.dynamics.mean(fed_back.mean());
            let (mut rules, mut observations) = (Vec::new(), Vec::new());
            for (i, (sensor, z)) in self.sensors.iter().zip(&draws.measurements[k]).enumerate() {
                let rule = match scheme {
                    Scheme::All | Scheme::Random => always.clone(),
                    Scheme::StateAndCovariance => CensoringRule::under(&self.dynamics, sensor, &fed_back, threshold)?,
                    Scheme::Ignored | Scheme::State => {
                        let step = own[i].advance(&self.dynamics, sensor, fed_back.mean())?;
                        CensoringRule::new(&step.innovation_covariance, threshold)?
                    }
                };
                let sends = match scheme {
                    Scheme::Random => draws.coins[k][i] < self.budget.rate(),
                    _ => rule.sends(&(z - sensor.mean(&expected))),
                };
                observations.push(Observation::from(sends.then_some(*z)));
                rules.push(rule);
            }
            let likelihood = match scheme {
                Scheme::State | Scheme::StateAndCovariance => {
                    likelihood_of_particles(&network, &rules, &expected, &observations)?
                }
                // A filter that ignores silence takes it for no observation.
                Scheme::All | Scheme::Random | Scheme::Ignored => {
                    let sensors = self.sensors.iter().zip(&observations);
                    let received = sensors.filter_map(|(sensor, seen)| seen.received().map(|z| (sensor, z)));
                    let values = received.map(|(sensor, z)| {
                        let noise = sensor.noise_covariance_at(&expected);
                        Ok(Observed::new(*sensor, Censored::values(&[*z], &noise, 1.0)?))
                    });
                    values.collect::<Result<Vec<_>, Error>>()?
                }
            };
            filter.step_in_place(&mut rng, &self.dynamics, &mut cloud, &[&likelihood])?;
            let mean = cloud.mean();
            let covariance = match scheme {
                Scheme::StateAndCovariance => cloud.covariance_about(&mean),
                _ => Matrix4::zeros(),
            };
            fed_back = Gaussian::from_trusted_parts(mean, covariance);
            Ok(Known {
                mean,
                variance: None,
                sent: observations.iter().filter(|o| o.received().is_some()).count(),
            })
        }))
    }
}

impl Setting for Field {
    type Scheme = Scheme;

    fn messages(&self) -> &[f64] {
        &self.messages
    }

    fn run(&self, context: &Context<'_>, at: At<'_>, schemes: &[Named<Scheme>]) -> Result<Vec<Ensemble>, Error> {
        let stream = context.stream("cfwmd-nonlinear");
        Plane::new(self, at.1)?.simulate(context, stream, self.trials, at, schemes)
    }
}
