//! The nonlinear experiments: a target in a plane among sensors of received power.

pub(super) mod figures;

use super::ensemble::{Ensemble, Record};
use crate::error::Error;
use crate::legacy::Context;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observation, Sensing};
use fewbits_densities::Particles;
use fewbits_filters::{ParticleFilter, Resampling, Schedule, Workspace};
use fewbits_models::{LinearGaussian, ReceivedPower, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// Parameters of a nonlinear figure.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Field {
    /// Monte-Carlo trials.
    trials: u64,
    /// Time steps of a trial.
    steps: u64,
    /// Message budgets `l`.
    messages: Vec<f64>,
    /// Particles of every filter.
    particles: u64,
    /// Distance of neighbouring sensors of the 3 by 3 grid (m).
    spacing_m: f64,
    /// Variance of the acceleration of each axis (m^2/s^4).
    acceleration_variance: f64,
    /// Variance of the measurement noise.
    noise_variance: f64,
    /// Whether the truth is drawn from the prior; the publication's starts at its mean.
    drawn_start: bool,
}

impl Field {
    fn new(messages: Vec<f64>) -> Self {
        Self {
            trials: 200,
            steps: 20,
            messages,
            particles: 10_000,
            spacing_m: 10.0,
            acceleration_variance: 0.1,
            noise_variance: 1.0,
            drawn_start: false,
        }
    }

    fn quicken(&mut self) {
        self.trials = 24;
        self.particles = 500;
    }
}

/// What is sent, and whether silence is fused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scheme {
    All,
    Random,
    /// Censored, silence ignored.
    Ignored,
    /// Censored with each sensor's own linearised recursion, silence fused.
    State,
    /// Censored with the particles' covariance, silence fused.
    StateAndCovariance,
}

type Named = (&'static str, Scheme);

const FOUR: [Named; 4] = [
    ("all", Scheme::All),
    ("random", Scheme::Random),
    ("CFoMD", Scheme::Ignored),
    ("CFwMD", Scheme::State),
];
const FUSED: [Named; 2] = [("CFwMD", Scheme::State), ("CFwMD2", Scheme::StateAndCovariance)];

struct World {
    dynamics: LinearGaussian<4, 2>,
    sensors: Vec<ReceivedPower<4>>,
    start: Gaussian<4>,
    steps: usize,
    particles: usize,
    drawn_start: bool,
}

/// Truth, measurements and coins of one trial.
struct Draws {
    truth: Vec<Vector4<f64>>,
    measurements: Vec<Vec<f64>>,
    coins: Vec<Vec<f64>>,
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::failed(error)
}

impl World {
    fn new(field: &Field) -> Result<Self, Error> {
        let dynamics = constant_velocity_2d(0.5, field.acceleration_variance).map_err(failed)?;
        let spacing = fewbits_numerics::error::positive("spacing_m", field.spacing_m)?;
        let sensors = (0..9)
            .map(|i| Vector2::new((f64::from(i % 3) - 1.0) * spacing, (f64::from(i / 3) - 1.0) * spacing))
            .map(|place| ReceivedPower::new(place, [0, 2], 1000.0, 1.0, 2.0, field.noise_variance))
            .collect::<Result<Vec<_>, _>>()
            .map_err(failed)?;
        let mean = Vector4::new(-8.0, 2.0, -8.0, 2.0);
        Ok(Self {
            dynamics,
            sensors,
            start: Gaussian::new(mean, Matrix4::from_diagonal(&Vector4::new(9.0, 4.0, 9.0, 4.0)))?,
            steps: field.steps as usize,
            particles: fewbits_numerics::error::at_least_one("particles", field.particles as usize)?,
            drawn_start: field.drawn_start,
        })
    }

    fn draw(&self, stream: Stream) -> Result<Draws, Error> {
        let mut rng = stream.named("truth").rng();
        let mut noise = stream.named("noise").rng();
        let mut coins = stream.named("coins").rng();
        let mut state = if self.drawn_start {
            self.start.sample(&mut rng)
        } else {
            *self.start.mean()
        };
        let mut draws = Draws {
            truth: Vec::new(),
            measurements: Vec::new(),
            coins: Vec::new(),
        };
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
        Particles::from_draws(self.particles, || {
            Vector4::from_fn(|d, _| mean[d] + deviations[d] * rng.sample::<f64, _>(StandardNormal))
        })
        .map_err(failed)
    }

    fn trial(&self, scheme: Scheme, messages: f64, draws: &Draws, stream: Stream) -> Result<Record, Error> {
        let budget = Budget::new(messages, self.sensors.len()).map_err(failed)?;
        let threshold = budget.threshold(1).map_err(failed)?;
        let mut rng = stream.fast_rng();
        let mut cloud = self.cloud(&mut rng)?;
        let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Always);
        let mut workspace = Workspace::default();
        let network = Network::new(self.sensors.clone(), threshold, Link::PERFECT).map_err(failed)?;
        let always = CensoringRule::scalar(1.0, 0.0).map_err(failed)?;
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
                    Scheme::StateAndCovariance => {
                        CensoringRule::under(&self.dynamics, sensor, &fed_back, threshold).map_err(failed)?
                    }
                    Scheme::Ignored | Scheme::State => {
                        let step = own[i]
                            .advance(&self.dynamics, sensor, fed_back.mean())
                            .map_err(failed)?;
                        CensoringRule::new(&step.innovation_covariance, threshold).map_err(failed)?
                    }
                };
                let sends = match scheme {
                    Scheme::Random => draws.coins[k][i] < budget.rate(),
                    _ => rule.sends(&(z - sensor.mean(&expected))),
                };
                observations.push(match scheme {
                    _ if sends => Observation::Received(z),
                    Scheme::State | Scheme::StateAndCovariance => Observation::Nothing,
                    // To a filter that ignores silence it is no more than an erased report.
                    _ => Observation::Erased,
                });
                rules.push(rule);
            }
            let sent = observations.iter().filter(|o| o.received().is_some()).count();
            let likelihood = network.likelihood(&rules, &expected, &observations).map_err(failed)?;
            filter
                .step_in_place(&mut rng, &self.dynamics, &mut cloud, &likelihood, &mut workspace)
                .map_err(failed)?;
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

/// Runs schemes at budgets on common trials. A pair of one trial and one scheme is the unit of parallel work.
fn run(context: &Context<'_>, field: &Field, cases: &[(Named, f64)]) -> Result<Vec<Ensemble>, Error> {
    let world = World::new(field)?;
    let stream = context.stream("cfwmd-nonlinear");
    let units = field.trials * cases.len() as u64;
    let records = context.monte_carlo(stream, units).run(|unit| -> Result<_, Error> {
        let (trial, case) = (unit.index / cases.len() as u64, (unit.index % cases.len() as u64) as usize);
        let ((_, scheme), messages) = cases[case];
        let stream = stream.indexed(trial);
        world.trial(scheme, messages, &world.draw(stream)?, stream.named("particles"))
    })?;
    let mut ensembles: Vec<_> = cases
        .iter()
        .map(|((name, _), messages)| Ensemble {
            scheme: (*name).to_owned(),
            messages: *messages,
            records: Vec::with_capacity(field.trials as usize),
        })
        .collect();
    for (index, record) in records.into_iter().enumerate() {
        ensembles[index % cases.len()].records.push(record);
    }
    Ok(ensembles)
}

fn every(schemes: &[Named], budgets: &[f64]) -> Vec<(Named, f64)> {
    budgets
        .iter()
        .flat_map(|l| schemes.iter().map(|scheme| (*scheme, *l)))
        .collect()
}
