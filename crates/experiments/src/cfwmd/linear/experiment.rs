//! One experiment: what all schemes of a trial share, and how each goes through it.

use super::scheme::{Method, Scheme};
use crate::cfwmd::rows::Record;
use crate::cfwmd::setting::Linear;
use crate::{Context, Error};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{JointBelief, LocalSensor, joint};
use fewbits_cfwmd::published::{ImputedBelief, fuse_received, imputing};
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion, OwnStep, Weighing};
use fewbits_cfwmd::schedule::expected_covariances;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, NumberFormat, Observation, Sensing};
use fewbits_densities::Particles;
use fewbits_filters::{ParticleFilter, Resampling, Schedule, Workspace, kalman};
use fewbits_models::{LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::linalg::semidefinite_factor;
use nalgebra::{SMatrix, SVector, Vector2};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Offline runs behind a scheduled threshold.
const SCHEDULE_RUNS: usize = 500;

/// One linear experiment at one budget.
pub(super) struct Experiment<const M: usize> {
    pub(super) dynamics: LinearGaussian<2, 1>,
    pub(super) sensor: LinearSensor<2, M>,
    pub(super) sensors: usize,
    pub(super) budget: Budget,
    pub(super) threshold: f64,
    pub(super) start: Gaussian<2>,
    pub(super) steps: usize,
    /// The sensors' own recursion and its rule, step by step.
    pub(super) own: Vec<(OwnStep<2, M>, CensoringRule<M>)>,
    /// Prior covariance of the state without any data.
    pub(super) open_loop: Vec<SMatrix<f64, 2, 2>>,
    /// Scheduled innovation rule, where a scheme asks for it.
    pub(super) scheduled: Vec<CensoringRule<M>>,
    /// Whether sensors report by their own estimates in any scheme.
    pub(super) local: bool,
}

type Sensors<const M: usize> = Network<LinearSensor<2, M>, 2, M>;

/// What all schemes of one trial share.
#[derive(Default)]
pub(super) struct Draws<const M: usize> {
    pub(super) truth: Vec<Vector2<f64>>,
    pub(super) measurements: Vec<Vec<SVector<f64, M>>>,
    pub(super) coins: Vec<Vec<f64>>,
    pub(super) losses: Vec<Vec<f64>>,
    /// What arrives from the sensors without feedback.
    pub(super) no_feedback: Vec<Vec<Observation<SVector<f64, M>>>>,
}

/// Measurement dimension that an experiment supports: which of the special schemes exist in it.
pub(super) trait Dimension<const M: usize> {
    /// Noise model of one sensor.
    fn sensor(variances: &[f64]) -> Result<LinearSensor<2, M>, Error>;
    /// Schemes with particles or with closed forms of their own.
    fn special(experiment: &Experiment<M>, scheme: Scheme, track: Track<'_, M>) -> Result<(), Error>;
}

/// The dimension of the measurement, as a type.
pub(super) struct Measured;

/// One trial in the making.
pub(super) struct Track<'a, const M: usize> {
    pub(super) draws: &'a Draws<M>,
    pub(super) stream: Stream,
    pub(super) record: &'a mut Record,
}

impl<const M: usize> Track<'_, M> {
    pub(super) fn note(&mut self, k: usize, belief: &Gaussian<2>, sent: usize) {
        let error = self.draws.truth[k] - belief.mean();
        self.record.position.push(error[0] * error[0]);
        self.record.velocity.push(error[1] * error[1]);
        self.record.sent.push(sent as f64);
        self.record
            .consistency
            .push(error[0] * error[0] / belief.covariance()[(0, 0)]);
    }
}

impl<const M: usize> Experiment<M>
where
    Measured: Dimension<M>,
{
    pub(super) fn new(
        context: &Context<'_>,
        setting: &Linear,
        messages: f64,
        schemes: &[(&'static str, Scheme)],
    ) -> Result<Self, Error> {
        let dynamics = constant_velocity_1d(1.0, setting.acceleration_variance)?;
        let sensor = Measured::sensor(&setting.noise_variances)?;
        let sensors = setting.sensors as usize;
        let budget = Budget::new(messages, sensors)?;
        let threshold = budget.threshold(M)?;
        let start = setting.belief()?;
        let steps = setting.steps as usize;
        let mut recursion = OwnRecursion::new(&start);
        let (mut own, mut open_loop) = (Vec::new(), Vec::new());
        let mut prior = start;
        for _ in 0..steps {
            let step = recursion.advance(&dynamics, &sensor, start.mean())?;
            let rule = CensoringRule::new(&step.innovation_covariance, threshold)?;
            own.push((step, rule));
            prior = kalman::predict(&dynamics, &prior);
            open_loop.push(*prior.covariance());
        }
        let mut experiment = Self {
            dynamics,
            sensor,
            sensors,
            budget,
            threshold,
            start,
            steps,
            own,
            open_loop,
            scheduled: Vec::new(),
            local: schemes
                .iter()
                .any(|(_, s)| matches!(s, Scheme::NoFeedback(_) | Scheme::Centred | Scheme::Unconditional)),
        };
        if schemes.iter().any(|(_, s)| s.needs_schedule()) {
            let network = experiment.network(0.0)?;
            let mut rng = context.stream("cfwmd-schedule").rng();
            let covariances = expected_covariances(
                &mut rng,
                &network,
                &experiment.dynamics,
                &experiment.start,
                steps,
                SCHEDULE_RUNS,
            )?;
            let rule = |p: &SMatrix<f64, 2, 2>| {
                let predicted = Gaussian::from_trusted_parts(Vector2::zeros(), *p);
                Ok::<_, Error>(network.rule_under(0, &predicted)?)
            };
            experiment.scheduled = covariances.iter().map(rule).collect::<Result<_, _>>()?;
        }
        Ok(experiment)
    }

    fn network(&self, loss: f64) -> Result<Sensors<M>, Error> {
        Ok(Network::new(vec![self.sensor; self.sensors], self.threshold, Link::lossy(loss)?)?)
    }

    pub(super) fn draw(&self, stream: Stream) -> Result<Draws<M>, Error> {
        let mut rng = stream.named("truth").rng();
        let mut noise = stream.named("noise").rng();
        let mut coins = stream.named("coins").rng();
        let mut losses = stream.named("losses").rng();
        let mut state = self.start.sample(&mut rng);
        let mut halves = (0..self.sensors)
            .map(|_| LocalSensor::new(self.sensor, self.threshold, NumberFormat::Double, &self.start))
            .collect::<Result<Vec<_>, _>>()?;
        let mut draws = Draws::default();
        for _ in 0..self.steps {
            state = self.dynamics.propagate(&mut rng, &state);
            let measurements: Vec<_> = (0..self.sensors)
                .map(|_| self.sensor.sample(&mut noise, &state))
                .collect();
            if self.local {
                let reports = halves.iter_mut().zip(&measurements);
                let reports = reports.map(|(half, z)| half.step(&mut noise, &self.dynamics, z).map(Observation::from));
                draws.no_feedback.push(reports.collect::<Result<_, _>>()?);
            }
            draws.truth.push(state);
            draws.measurements.push(measurements);
            draws.coins.push((0..self.sensors).map(|_| coins.random()).collect());
            draws.losses.push((0..self.sensors).map(|_| losses.random()).collect());
        }
        Ok(draws)
    }

    pub(super) fn trial(&self, scheme: Scheme, draws: &Draws<M>, stream: Stream) -> Result<Record, Error> {
        let mut record = Record::default();
        let mut track = Track {
            draws,
            stream,
            record: &mut record,
        };
        match scheme {
            Scheme::All => self.values_only(&mut track, |_, _, _, _| true)?,
            Scheme::Random => {
                let rate = self.budget.rate();
                self.values_only(&mut track, |k, i, _, _| draws.coins[k][i] < rate)?;
            }
            Scheme::Ignored => {
                self.values_only(&mut track, |k, _, z, prediction| self.own[k].1.sends(&(z - prediction)))?;
            }
            Scheme::Gaussian(weighing) => self.gaussian(&mut track, weighing, 0.0, 0.0)?,
            Scheme::Lossy { loss, modelled } => {
                self.gaussian(&mut track, Weighing::OwnFilter, loss, if modelled { loss } else { 0.0 })?;
            }
            Scheme::NoFeedback(method) => self.no_feedback(&mut track, method, &self.network(0.0)?)?,
            Scheme::Particles(count, weighing) => self.particles(&mut track, count, weighing)?,
            special => Measured::special(self, special, track)?,
        }
        Ok(record)
    }

    fn no_feedback(
        &self,
        track: &mut Track<'_, M>,
        method: Method,
        network: &Sensors<M>,
    ) -> Result<(), fewbits_cfwmd::Error> {
        let mut rng = track.stream.named("particles").fast_rng();
        let mut belief = self.start;
        let mut gaussian = JointBelief::new(&self.start, self.sensors)?;
        let particles = if let Method::Imputed(count) = method { count } else { 1 };
        let mut imputed = ImputedBelief::new(&self.start, self.sensors, particles)?;
        for (k, observations) in track.draws.no_feedback.iter().enumerate() {
            let received = observations.iter().filter(|o| o.received().is_some()).count();
            match method {
                Method::Ignored => {
                    belief = fuse_received(network, &kalman::predict(&self.dynamics, &belief), observations)?.0;
                }
                Method::Joint => {
                    gaussian = joint::step(network, &self.dynamics, &gaussian, observations)?.0;
                    belief = gaussian.state();
                }
                Method::Imputed(_) => {
                    imputed = imputing::step(&mut rng, network, &self.dynamics, &imputed, observations)?.0;
                    belief = imputed.state();
                }
            }
            track.note(k, &belief, received);
        }
        Ok(())
    }

    /// A Kalman filter on what is sent, with its own feedback loop.
    fn values_only(
        &self,
        track: &mut Track<'_, M>,
        sends: impl Fn(usize, usize, &SVector<f64, M>, &SVector<f64, M>) -> bool,
    ) -> Result<(), Error> {
        let mut belief = self.start;
        for k in 0..self.steps {
            belief = kalman::predict(&self.dynamics, &belief);
            let prediction = self.sensor.matrix() * belief.mean();
            let mut sent = 0;
            for (i, z) in track.draws.measurements[k].iter().enumerate() {
                if sends(k, i, z, &prediction) {
                    belief = kalman::update(&self.sensor, &belief, z)?.0;
                    sent += 1;
                }
            }
            track.note(k, &belief, sent);
        }
        Ok(())
    }

    fn rules(
        &self,
        k: usize,
        weighing: Weighing,
        network: &Sensors<M>,
        predicted: &Gaussian<2>,
    ) -> Result<Vec<CensoringRule<M>>, Error> {
        let rule = match weighing {
            Weighing::OwnFilter => self.own[k].1.clone(),
            Weighing::FusionCentre => network.rule_under(0, predicted)?,
            Weighing::Scheduled => self.scheduled[k].clone(),
        };
        Ok(vec![rule; self.sensors])
    }

    /// What arrives in step `k` under these rules, and how many messages were sent.
    pub(super) fn observe(
        &self,
        k: usize,
        draws: &Draws<M>,
        rules: &[CensoringRule<M>],
        broadcast: &Vector2<f64>,
        loss: f64,
    ) -> (Vec<Observation<SVector<f64, M>>>, usize) {
        let prediction = self.sensor.matrix() * broadcast;
        let mut sent = 0;
        let observations = draws.measurements[k]
            .iter()
            .enumerate()
            .map(|(i, z)| {
                let sends = rules[i].sends(&(z - prediction));
                sent += usize::from(sends);
                if sends && draws.losses[k][i] >= loss {
                    Observation::Received(*z)
                } else {
                    Observation::Nothing
                }
            })
            .collect();
        (observations, sent)
    }

    fn gaussian(&self, track: &mut Track<'_, M>, weighing: Weighing, loss: f64, believed: f64) -> Result<(), Error> {
        let network = self.network(believed)?;
        let mut belief = self.start;
        for k in 0..self.steps {
            let predicted = kalman::predict(&self.dynamics, &belief);
            let rules = self.rules(k, weighing, &network, &predicted)?;
            let (observations, sent) = self.observe(k, track.draws, &rules, predicted.mean(), loss);
            belief = network.fuse(&predicted, &rules, predicted.mean(), &observations)?.0;
            track.note(k, &belief, sent);
        }
        Ok(())
    }

    /// A bootstrap filter.
    fn particles(&self, track: &mut Track<'_, M>, count: usize, weighing: Weighing) -> Result<(), Error> {
        let network = self.network(0.0)?;
        let mut rng = track.stream.named("particles").fast_rng();
        let root = semidefinite_factor("initial covariance", self.start.covariance())?;
        let mut draw = || self.start.mean() + root * Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let mut cloud = Particles::from_draws(count, &mut draw)?;
        let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Always);
        let mut workspace = Workspace::default();
        for k in 0..self.steps {
            filter.predict(&mut rng, &self.dynamics, &mut cloud, &mut workspace)?;
            let broadcast = cloud.mean();
            let predicted = Gaussian::from_trusted_parts(broadcast, cloud.covariance_about(&broadcast));
            let rules = self.rules(k, weighing, &network, &predicted)?;
            let (observations, sent) = self.observe(k, track.draws, &rules, &broadcast, 0.0);
            let likelihood = network.likelihood(&rules, &broadcast, &observations)?;
            filter.update(&mut cloud, &likelihood)?;
            let mean = cloud.mean();
            let belief = Gaussian::from_trusted_parts(mean, cloud.covariance_about(&mean));
            track.note(k, &belief, sent);
        }
        Ok(())
    }
}
