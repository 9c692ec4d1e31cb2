//! The linear experiments: a target with constant velocity, identical sensors, every scheme on the same truth and noise.

use super::rows::Ensemble;
use super::setting::{Linear, Setting};
use super::world::{At, Centre, Draws, Known, Named, World};
use crate::prelude::*;
use fewbits_baselines::cfwmd::trigger::{StochasticTrigger, Triggered};
use fewbits_baselines::cfwmd::{ImputedBelief, Weighing, fuse_received, imputing, likelihood_of_particles};
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{JointBelief, LocalSensor, joint};
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion, OwnStep};
use fewbits_cfwmd::schedule::expected_covariances;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Likelihood, LinearSensing, NumberFormat, Scheme as _};
use fewbits_densities::Particles;
use fewbits_filters::{BootstrapFilter, Resampling, ResamplingRule, Schedule, StateFilter, assumed_density, kalman};
use fewbits_models::{LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_numerics::linalg::semidefinite_factor;

/// How a fusion centre without feedback treats silence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Not at all.
    Ignored,
    /// Joint Gaussian belief about the state and the sensors' estimates.
    Joint,
    /// Withheld measurements imputed, so many particles.
    Imputed(usize),
    /// As if each sensor's estimate were scattered about the centre's own (a heuristic).
    Centred,
    /// With the sensor's estimate given the state but not the data (the paper's law, corrected).
    Unconditional,
}

/// What is sent, and what the fusion centre makes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scheme {
    /// Everything is sent.
    All,
    /// A coin decides.
    Random,
    /// Censoring, silence ignored (CFoMD), own feedback loop.
    Ignored,
    /// Censoring, silence fused by the Gaussian centre.
    Gaussian(Weighing),
    /// Censoring, silence fused by a bootstrap particle filter.
    Particles(usize, Weighing),
    /// Random Gaussian-preserving trigger, weighed with the sensor's own or the centre's innovation variance.
    Trigger(Weighing),
    /// As `Gaussian`, over a link that loses messages; the centre knows the loss rate or believes there is none.
    Lossy { loss: f64, modelled: bool },
    /// No feedback.
    NoFeedback(Method),
}

impl Setting for Linear {
    type Scheme = Scheme;

    fn messages(&self) -> &[f64] {
        &self.messages
    }

    /// On common random numbers. Schemes for scalar measurements are left out where position and velocity are measured.
    fn run(&self, context: &Context<'_>, at: At<'_>, schemes: &[Named<Scheme>]) -> Result<Vec<Ensemble>, Error> {
        // One stream for all figures and budgets: schemes differ by what they do, not by their luck.
        let stream = context.stream("cfwmd-linear");
        let scheduled = schemes.iter().any(|(_, s)| *s == Scheme::Gaussian(Weighing::Scheduled));
        let schedule = scheduled.then(|| context.stream("cfwmd-schedule"));
        if self.noise_variances.len() == 1 {
            Line::<1>::new(self, at.1, schedule)?.simulate(context, stream, self.trials, at, schemes)
        } else {
            use Method::{Centred, Unconditional};
            let mut schemes = schemes.to_vec();
            schemes.retain(|(_, s)| !matches!(s, Scheme::Trigger(_) | Scheme::NoFeedback(Centred | Unconditional)));
            Line::<2>::new(self, at.1, schedule)?.simulate(context, stream, self.trials, at, &schemes)
        }
    }
}

/// Offline runs behind a scheduled threshold.
const SCHEDULE_RUNS: usize = 500;

/// One linear experiment at one budget: the position is measured, or position and velocity.
struct Line<const M: usize> {
    dynamics: LinearGaussian<2, 1>,
    sensors: Vec<LinearSensor<2, M>>,
    budget: Budget,
    threshold: f64,
    start: Gaussian<2>,
    steps: usize,
    /// The sensors' own recursion and its rule, step by step.
    own: Vec<(OwnStep<2, M>, CensoringRule<M>)>,
    /// Scheduled rules, where a scheme asks for them.
    scheduled: Vec<CensoringRule<M>>,
}

type Sensors<const M: usize> = Network<LinearSensor<2, M>, 2, M>;
/// The direction in which silence measures the state, the centre of its interval, and its noise.
type Scattered<const M: usize> = (SMatrix<f64, M, 2>, SVector<f64, M>, SMatrix<f64, M, M>);

impl<const M: usize> Line<M> {
    fn new(setting: &Linear, messages: f64, schedule: Option<Stream>) -> Result<Self, Error> {
        let dynamics = constant_velocity_1d(1.0, setting.acceleration_variance)?;
        let variances = SVector::from_fn(|i, _| setting.noise_variances[i]);
        let sensor = LinearSensor::new(SMatrix::identity(), SMatrix::from_diagonal(&variances))?;
        let budget = Budget::new(messages, setting.sensors as usize)?;
        let threshold = budget.threshold(M)?;
        let start = setting.belief()?;
        let mut recursion = OwnRecursion::new(&start);
        let own = (0..setting.steps).map(|_| {
            let step = recursion.advance(&dynamics, &sensor, start.mean())?;
            let rule = CensoringRule::new(&step.innovation_covariance, threshold)?;
            Ok((step, rule))
        });
        let mut line = Self {
            own: own.collect::<Result<_, Error>>()?,
            dynamics,
            sensors: vec![sensor; setting.sensors as usize],
            budget,
            threshold,
            start,
            steps: setting.steps as usize,
            scheduled: Vec::new(),
        };
        if let Some(stream) = schedule {
            let network = line.network(0.0)?;
            let covariances =
                expected_covariances(&mut stream.rng(), &network, &dynamics, &start, line.steps, SCHEDULE_RUNS)?;
            let rule = |p: &SMatrix<f64, 2, 2>| {
                let predicted = Gaussian::from_trusted_parts(Vector2::zeros(), *p);
                Ok::<_, Error>(network.rule_under(0, &predicted)?)
            };
            line.scheduled = covariances.iter().map(rule).collect::<Result<_, _>>()?;
        }
        Ok(line)
    }

    fn network(&self, loss: f64) -> Result<Sensors<M>, Error> {
        Ok(Network::new(self.sensors.clone(), self.threshold, Link::lossy(loss)?)?)
    }

    /// A Kalman filter on what is sent, with its own feedback loop: `sends` is asked with step, sensor and innovation.
    fn values_only<'a>(
        &'a self,
        draws: &'a Draws<2, M>,
        sends: impl Fn(usize, usize, &SVector<f64, M>) -> bool + 'a,
    ) -> Centre<'a, 2> {
        let mut belief = self.start;
        Box::new(move |k| {
            belief = kalman::predict(&self.dynamics, &belief);
            let (predicted, mut sent) = (*belief.mean(), 0);
            for (i, (sensor, z)) in self.sensors.iter().zip(&draws.measurements[k]).enumerate() {
                if sends(k, i, &(z - sensor.matrix() * predicted)) {
                    belief = kalman::update(sensor, &belief, z)?.0;
                    sent += 1;
                }
            }
            Ok(Known::of(&belief, sent))
        })
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
        Ok(vec![rule; self.sensors.len()])
    }

    /// What arrives in step `k` under these rules, and how many messages were sent.
    fn observe(
        &self,
        k: usize,
        draws: &Draws<2, M>,
        rules: &[CensoringRule<M>],
        broadcast: &Vector2<f64>,
        loss: f64,
    ) -> (Vec<Observation<SVector<f64, M>>>, usize) {
        let mut sent = 0;
        let observe = |(i, (sensor, z)): (usize, (&LinearSensor<2, M>, &SVector<f64, M>))| {
            let sends = rules[i].sends(&(z - sensor.matrix() * broadcast));
            sent += usize::from(sends);
            (sends && draws.losses[k][i] >= loss).then_some(*z).into()
        };
        let measured = self.sensors.iter().zip(&draws.measurements[k]).enumerate();
        (measured.map(observe).collect(), sent)
    }

    fn gaussian<'a>(
        &'a self,
        draws: &'a Draws<2, M>,
        weighing: Weighing,
        loss: f64,
        believed: f64,
    ) -> Result<Centre<'a, 2>, Error> {
        let network = self.network(believed)?;
        let mut belief = self.start;
        Ok(Box::new(move |k| {
            let predicted = kalman::predict(&self.dynamics, &belief);
            let rules = self.rules(k, weighing, &network, &predicted)?;
            let (observations, sent) = self.observe(k, draws, &rules, predicted.mean(), loss);
            let observed: Vec<_> = observations.into_iter().map(Some).collect();
            belief = predicted;
            network
                .likelihoods(&rules, predicted.mean(), &observed)?
                .condition(&mut belief)?;
            Ok(Known::of(&belief, sent))
        }))
    }

    /// A bootstrap filter.
    fn particles<'a>(
        &'a self,
        draws: &'a Draws<2, M>,
        count: usize,
        weighing: Weighing,
        stream: Stream,
    ) -> Result<Centre<'a, 2>, Error> {
        let network = self.network(0.0)?;
        let mut rng = stream.named("particles").fast_rng();
        let root = semidefinite_factor("initial covariance", self.start.covariance())?;
        let mut draw = || self.start.mean() + root * Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let mut cloud = Particles::from_draws(count, &mut draw)?;
        let rule = ResamplingRule {
            resampling: Resampling::Systematic,
            schedule: Schedule::Always,
        };
        let mut filter = BootstrapFilter::new(rule, count)?;
        let moments = |cloud: &Particles<2>| {
            let mean = cloud.mean();
            Gaussian::from_trusted_parts(mean, cloud.covariance_about(&mean))
        };
        Ok(Box::new(move |k| {
            filter.predict(&mut rng, &self.dynamics, &mut cloud)?;
            let predicted = moments(&cloud);
            let rules = self.rules(k, weighing, &network, &predicted)?;
            let (observations, sent) = self.observe(k, draws, &rules, predicted.mean(), 0.0);
            let likelihood = likelihood_of_particles(&network, &rules, predicted.mean(), &observations)?;
            filter.update(&mut rng, &mut cloud, &[&likelihood])?;
            Ok(Known::of(&moments(&cloud), sent))
        }))
    }

    /// Of scalar measurements.
    fn trigger<'a>(&'a self, draws: &'a Draws<2, M>, weighing: Weighing) -> Result<Centre<'a, 2>, Error> {
        let sensor = &self.sensors[0];
        let sensing = LinearSensor::scalar(sensor.matrix().row(0).transpose(), sensor.noise_covariance()[(0, 0)])?;
        let mut belief = self.start;
        Ok(Box::new(move |k| {
            belief = kalman::predict(&self.dynamics, &belief);
            let broadcast = *belief.mean();
            let s = match weighing {
                Weighing::OwnFilter => self.own[k].0.innovation_covariance[(0, 0)],
                _ => belief.covariance()[(0, 0)] + sensing.noise_variance(),
            };
            let trigger = StochasticTrigger::for_rate(self.budget.rate(), s)?;
            let scheme = Triggered { sensing, trigger };
            let mut sent = 0;
            for (z, coin) in draws.measurements[k].iter().zip(&draws.coins[k]) {
                let sends = *coin < trigger.probability(z[0] - sensing.direction().dot(&broadcast));
                sent += usize::from(sends);
                let factor = scheme.factor(&broadcast, &sends.then_some(z[0]).into(), &Link::PERFECT)?;
                belief = assumed_density::update(&belief, sensing.matrix(), &factor)?.0;
            }
            Ok(Known::of(&belief, sent))
        }))
    }

    fn no_feedback<'a>(
        &'a self,
        draws: &'a Draws<2, M>,
        method: Method,
        stream: Stream,
    ) -> Result<Centre<'a, 2>, Error> {
        let network = self.network(0.0)?;
        let mut rng = stream.named("particles").fast_rng();
        let half = |sensor| LocalSensor::new(sensor, self.threshold, NumberFormat::Double, &self.start);
        let mut halves = self.sensors.iter().copied().map(half).collect::<Result<Vec<_>, _>>()?;
        let (mut belief, mut prior) = (self.start, self.start);
        let mut gaussian = JointBelief::new(&self.start, halves.len())?;
        let particles = if let Method::Imputed(count) = method { count } else { 1 };
        let mut imputed = ImputedBelief::new(&self.start, halves.len(), particles)?;
        Ok(Box::new(move |k| {
            let reports = halves.iter_mut().zip(&draws.measurements[k]);
            let reports = reports.map(|(half, z)| half.step(&self.dynamics, z).map(Observation::from));
            let observations = reports.collect::<Result<Vec<_>, _>>()?;
            let received = observations.iter().filter(|o| o.received().is_some()).count();
            let predicted = kalman::predict(&self.dynamics, &belief);
            prior = kalman::predict(&self.dynamics, &prior);
            belief = match method {
                Method::Joint => {
                    gaussian = joint::step(&network, &self.dynamics, &gaussian, &observations)?.0;
                    gaussian.state()
                }
                Method::Imputed(_) => {
                    imputed = imputing::step(&mut rng, &network, &self.dynamics, &imputed, &observations)?.0;
                    imputed.state()
                }
                Method::Ignored | Method::Centred | Method::Unconditional => {
                    let known = fuse_received(&network, &predicted, &observations)?.0;
                    match self.scattered(method, k, &predicted, &prior) {
                        Some((direction, centre, noise)) if received < observations.len() => {
                            let silent = MissingReports {
                                nothing: observations.len() - received,
                                lost: 0,
                            };
                            let factor = Censored::missing(&self.own[k].1, &centre, &noise, &Link::PERFECT, silent)?;
                            assumed_density::update(&known, &direction, &factor)?.0
                        }
                        _ => known,
                    }
                }
            };
            Ok(Known::of(&belief, received))
        }))
    }

    /// Where a guess at the sensors' estimates puts their silence in step `k`. For scalar measurements, and for comparison only.
    fn scattered(
        &self,
        method: Method,
        k: usize,
        predicted: &Gaussian<2>,
        prior: &Gaussian<2>,
    ) -> Option<Scattered<M>> {
        let (sensor, step) = (&self.sensors[0], &self.own[k].0);
        let h = sensor.matrix();
        match method {
            Method::Centred => Some((*h, h * predicted.mean(), step.innovation_covariance)),
            Method::Unconditional => {
                // nu given x has mean h P Sigma^-1 (x - m) and variance h (P - P Sigma^-1 P) h' + r.
                let spread = prior.covariance() + SMatrix::identity() * 1e-9;
                let inverse = spread.try_inverse().unwrap_or_else(SMatrix::zeros);
                let direction = (inverse * step.predicted * h.transpose()).transpose();
                let own = step.predicted * h.transpose();
                let variance = h * own - direction * own;
                let noise = variance.map(|v| v.max(0.0)) + LinearSensing::noise_covariance(sensor);
                Some((direction, direction * prior.mean(), noise))
            }
            _ => None,
        }
    }
}

impl<const M: usize> World<2, M> for Line<M> {
    type Scheme = Scheme;

    fn draw(&self, stream: Stream) -> Draws<2, M> {
        Draws::new(&self.dynamics, &self.sensors, &self.start, true, self.steps, stream)
    }

    fn centre<'a>(&'a self, scheme: Scheme, draws: &'a Draws<2, M>, stream: Stream) -> Result<Centre<'a, 2>, Error> {
        let stream = stream.named("scheme");
        match scheme {
            Scheme::All => Ok(self.values_only(draws, |_, _, _| true)),
            Scheme::Random => Ok(self.values_only(draws, |k, i, _| draws.coins[k][i] < self.budget.rate())),
            Scheme::Ignored => Ok(self.values_only(draws, |k, _, innovation| self.own[k].1.sends(innovation))),
            Scheme::Gaussian(weighing) => self.gaussian(draws, weighing, 0.0, 0.0),
            Scheme::Lossy { loss, modelled } => {
                self.gaussian(draws, Weighing::OwnFilter, loss, if modelled { loss } else { 0.0 })
            }
            Scheme::Particles(count, weighing) => self.particles(draws, count, weighing, stream),
            Scheme::Trigger(weighing) => self.trigger(draws, weighing),
            Scheme::NoFeedback(method) => self.no_feedback(draws, method, stream),
        }
    }
}
