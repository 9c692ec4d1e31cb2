//! The nonlinear experiments: a target in a plane among sensors of received power.

use super::rows::{Ensemble, Record, simulate};
use super::setting::{Field, Setting, cost};
use crate::{Context, Cost, Error};
use fewbits_cfwmd::censored::Censored;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observation, Observed, Sensing};
use fewbits_densities::Particles;
use fewbits_filters::{ParticleFilter, Resampling, Schedule, Workspace};
use fewbits_models::{LinearGaussian, ReceivedPower, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

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

pub(super) struct World {
    dynamics: LinearGaussian<4, 2>,
    pub(super) sensors: Vec<ReceivedPower<4>>,
    pub(super) start: Gaussian<4>,
    steps: usize,
    particles: usize,
    drawn_start: bool,
}

/// Truth, measurements and coins of one trial.
#[derive(Default)]
pub(super) struct Draws {
    pub(super) truth: Vec<Vector4<f64>>,
    measurements: Vec<Vec<f64>>,
    coins: Vec<Vec<f64>>,
}

impl World {
    pub(super) fn new(field: &Field) -> Result<Self, Error> {
        let dynamics = constant_velocity_2d(0.5, field.acceleration_variance)?;
        let sensors = (0..9)
            .map(|i| Vector2::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0) * field.spacing_m)
            .map(|place| ReceivedPower::new(place, [0, 2], 1000.0, 1.0, 2.0, field.noise_variance))
            .collect::<Result<Vec<_>, _>>()?;
        let (mean, variances) =
            (Vector4::from_column_slice(&field.start), Vector4::from_column_slice(&field.start_variances));
        Ok(Self {
            dynamics,
            sensors,
            start: Gaussian::new(mean, Matrix4::from_diagonal(&variances))?,
            steps: field.steps as usize,
            particles: field.particles as usize,
            drawn_start: field.drawn_start.unwrap_or(false),
        })
    }

    pub(super) fn draw(&self, stream: Stream) -> Result<Draws, Error> {
        let mut rng = stream.named("truth").rng();
        let mut noise = stream.named("noise").rng();
        let mut coins = stream.named("coins").rng();
        let mut state = if self.drawn_start {
            self.start.sample(&mut rng)
        } else {
            *self.start.mean()
        };
        let mut draws = Draws::default();
        for _ in 0..self.steps {
            state = self.dynamics.propagate(&mut rng, &state);
            draws.truth.push(state);
            draws
                .measurements
                .push(self.sensors.iter().map(|s| s.sample(&mut noise, &state)[0]).collect());
            draws.coins.push(self.sensors.iter().map(|_| coins.random()).collect());
        }
        Ok(draws)
    }

    /// Particles from the prior, whose axes are independent.
    fn cloud<R: Rng + ?Sized>(&self, rng: &mut R) -> Result<Particles<4>, Error> {
        let (mean, deviations) = (self.start.mean(), self.start.standard_deviations());
        let mut draw = || Vector4::from_fn(|d, _| mean[d] + deviations[d] * rng.sample::<f64, _>(StandardNormal));
        Ok(Particles::from_draws(self.particles, &mut draw)?)
    }

    fn trial(&self, scheme: Scheme, messages: f64, draws: &Draws, stream: Stream) -> Result<Record, Error> {
        let budget = Budget::new(messages, self.sensors.len())?;
        let threshold = budget.threshold(1)?;
        let mut rng = stream.fast_rng();
        let mut cloud = self.cloud(&mut rng)?;
        let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Always);
        let mut workspace = Workspace::default();
        let network = Network::new(self.sensors.clone(), threshold, Link::PERFECT)?;
        let always = CensoringRule::scalar(1.0, 0.0)?;
        let mut own = vec![OwnRecursion::new(&self.start); self.sensors.len()];
        // What the fusion centre fed back last: its estimate and, for the second variant, its covariance.
        let mut fed_back = self.start;
        let mut record = Record::default();
        for k in 0..self.steps {
            let expected = self.dynamics.mean(fed_back.mean());
            let (mut rules, mut observations) = (Vec::new(), Vec::new());
            for (i, sensor) in self.sensors.iter().enumerate() {
                let z = Vector1::new(draws.measurements[k][i]);
                let rule = match scheme {
                    Scheme::All | Scheme::Random => always.clone(),
                    Scheme::StateAndCovariance => CensoringRule::under(&self.dynamics, sensor, &fed_back, threshold)?,
                    Scheme::Ignored | Scheme::State => {
                        let step = own[i].advance(&self.dynamics, sensor, fed_back.mean())?;
                        CensoringRule::new(&step.innovation_covariance, threshold)?
                    }
                };
                let sends = match scheme {
                    Scheme::Random => draws.coins[k][i] < budget.rate(),
                    _ => rule.sends(&(z - sensor.mean(&expected))),
                };
                observations.push(if sends {
                    Observation::Received(z)
                } else {
                    Observation::Nothing
                });
                rules.push(rule);
            }
            let sent = observations.iter().filter(|o| o.received().is_some()).count();
            let likelihood = match scheme {
                Scheme::State | Scheme::StateAndCovariance => network.likelihood(&rules, &expected, &observations)?,
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
            filter.step_in_place(&mut rng, &self.dynamics, &mut cloud, &likelihood, &mut workspace)?;
            let mean = cloud.mean();
            let covariance = match scheme {
                Scheme::StateAndCovariance => cloud.covariance_about(&mean),
                _ => Matrix4::zeros(),
            };
            fed_back = Gaussian::from_trusted_parts(mean, covariance);
            let error = draws.truth[k] - mean;
            record.position.push(error[0] * error[0] + error[2] * error[2]);
            record.velocity.push(error[1] * error[1] + error[3] * error[3]);
            record.sent.push(sent as f64);
        }
        Ok(record)
    }
}

impl Setting for Field {
    type Scheme = Scheme;

    fn messages(&self) -> &[f64] {
        &self.messages
    }

    fn cost(&self) -> Cost {
        cost(self.trials, self.steps, self.messages.len(), self.particles as f64 * 1e-7)
    }

    fn run(
        &self,
        context: &Context<'_>,
        name: &str,
        messages: f64,
        schemes: &[(&'static str, Scheme)],
    ) -> Result<Vec<Ensemble>, Error> {
        let world = World::new(self)?;
        simulate(
            context,
            context.stream("cfwmd-nonlinear"),
            self.trials,
            (name, messages),
            schemes,
            |stream| world.draw(stream),
            |scheme, draws, stream| world.trial(*scheme, messages, draws, stream.named("particles")),
        )
    }
}
