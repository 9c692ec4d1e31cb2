//! What the worlds share: truth, measurements and coins of a trial, and every scheme on every trial.

use super::rows::{Ensemble, Moment, Run};
use crate::prelude::*;

/// What all schemes of one trial share, an entry a step.
#[derive(Default)]
pub(super) struct Draws<const D: usize, const M: usize> {
    pub(super) truth: Vec<SVector<f64, D>>,
    pub(super) measurements: Vec<Vec<SVector<f64, M>>>,
    /// A uniform number for each sensor.
    pub(super) coins: Vec<Vec<f64>>,
    /// Another one, for its link.
    pub(super) losses: Vec<Vec<f64>>,
}

impl<const D: usize, const M: usize> Draws<D, M> {
    /// One trial from a start that is drawn, or known.
    pub(super) fn new(
        dynamics: &impl Dynamics<D>,
        sensors: &[impl Sensing<D, M>],
        start: &Gaussian<D>,
        drawn: bool,
        steps: usize,
        stream: Stream,
    ) -> Self {
        let [mut rng, mut noise, mut coins, mut losses] =
            ["truth", "noise", "coins", "losses"].map(|purpose| stream.named(purpose).rng());
        let mut state = if drawn { start.sample(&mut rng) } else { *start.mean() };
        let mut draws = Self::default();
        for _ in 0..steps {
            state = dynamics.propagate(&mut rng, &state);
            draws.truth.push(state);
            let measurements = sensors.iter().map(|sensor| sensor.sample(&mut noise, &state));
            draws.measurements.push(measurements.collect());
            draws.coins.push(sensors.iter().map(|_| coins.random()).collect());
            draws.losses.push(sensors.iter().map(|_| losses.random()).collect());
        }
        draws
    }
}

/// What the fusion centre knows after a step.
pub(super) struct Known<const D: usize> {
    pub(super) mean: SVector<f64, D>,
    /// Variance of the position, where the belief has one to offer.
    pub(super) variance: Option<f64>,
    /// Messages sent in the step.
    pub(super) sent: usize,
}

impl<const D: usize> Known<D> {
    pub(super) fn of(belief: &Gaussian<D>, sent: usize) -> Self {
        Self {
            mean: *belief.mean(),
            variance: Some(belief.covariance()[(0, 0)]),
            sent,
        }
    }
}

/// A fusion centre as it goes from step to step, called with their numbers.
pub(super) type Centre<'a, const D: usize> = Box<dyn FnMut(usize) -> Result<Known<D>, Error> + 'a>;

/// A scheme under its name in the tables.
pub(super) type Named<S> = (&'static str, S);

/// What a figure calls the setting of its runs, and their message budget.
pub(super) type At<'a> = (&'a str, f64);

/// A world whose states alternate positions and velocities.
pub(super) trait World<const D: usize, const M: usize>: Sync {
    /// What is sent, and what is made of it.
    type Scheme: Copy + Sync;

    fn draw(&self, stream: Stream) -> Draws<D, M>;

    /// The fusion centre of a scheme.
    fn centre<'a>(
        &'a self,
        scheme: Self::Scheme,
        draws: &'a Draws<D, M>,
        stream: Stream,
    ) -> Result<Centre<'a, D>, Error>;

    /// Every scheme on every trial.
    fn simulate(
        &self,
        context: &Context<'_>,
        stream: Stream,
        trials: u64,
        (world, messages): At<'_>,
        schemes: &[Named<Self::Scheme>],
    ) -> Result<Vec<Ensemble>, Error> {
        let run = |scheme: Self::Scheme, draws: &Draws<D, M>, stream: Stream| -> Result<Vec<Moment>, Error> {
            let mut centre = self.centre(scheme, draws, stream)?;
            let step = |(k, truth): (usize, &SVector<f64, D>)| {
                let known = centre(k)?;
                let squared = (truth - known.mean).map(|error| error * error);
                Ok(Moment {
                    position: squared.iter().step_by(2).sum(),
                    velocity: squared.iter().skip(1).step_by(2).sum(),
                    sent: known.sent as f64,
                    consistency: known.variance.map(|variance| squared[0] / variance),
                })
            };
            draws.truth.iter().enumerate().map(step).collect()
        };
        let every = |it: Trial| -> Result<Vec<Vec<Moment>>, Error> {
            let draws = self.draw(it.stream);
            schemes
                .iter()
                .map(|(_, scheme)| run(*scheme, &draws, it.stream))
                .collect()
        };
        let mut trials = context.trials(stream, trials, every)?;
        let of = |(place, (scheme, _)): (usize, &Named<Self::Scheme>)| Ensemble {
            run: Run {
                scheme,
                world: world.to_owned(),
                l: messages,
            },
            trials: trials.iter_mut().map(|t| std::mem::take(&mut t[place])).collect(),
        };
        Ok(schemes.iter().enumerate().map(of).collect())
    }
}
