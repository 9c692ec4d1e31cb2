//! The linear experiments: a target with constant velocity, identical sensors, every scheme on the same truth and noise.

mod experiment;
mod scalar_only;
mod scheme;

pub use scheme::{Method, Scheme};

use super::rows::{Ensemble, simulate};
use super::setting::{Linear, Setting, cost};
use crate::{Context, Cost, Error};
use experiment::{Dimension, Experiment, Measured, Track};
use fewbits_models::LinearSensor;
use nalgebra::{SMatrix, Vector2};
use std::hint::black_box;
use std::time::Instant;

impl Setting for Linear {
    type Scheme = Scheme;

    fn messages(&self) -> &[f64] {
        &self.messages
    }

    fn cost(&self) -> Cost {
        let fusion = self.sensors as f64 * 2e-6 + self.cloud() as f64 * 2e-8;
        cost(self.trials, self.steps, self.messages.len(), fusion)
    }

    fn run(
        &self,
        context: &Context<'_>,
        world: &str,
        messages: f64,
        schemes: &[(&'static str, Scheme)],
    ) -> Result<Vec<Ensemble>, Error> {
        match self.noise_variances.len() {
            1 => run::<1>(context, self, world, messages, schemes),
            _ => run::<2>(context, self, world, messages, schemes),
        }
    }
}

/// Runs schemes over the trials of a setting at one budget, on common random numbers. Schemes for scalar measurements are left
/// out where position and velocity are measured.
fn run<const M: usize>(
    context: &Context<'_>,
    setting: &Linear,
    world: &str,
    messages: f64,
    schemes: &[(&'static str, Scheme)],
) -> Result<Vec<Ensemble>, Error>
where
    Measured: Dimension<M>,
{
    let schemes: Vec<_> = schemes
        .iter()
        .copied()
        .filter(|(_, s)| M == 1 || !s.needs_scalars())
        .collect();
    let experiment = Experiment::<M>::new(context, setting, messages, &schemes)?;
    // One stream for all figures and budgets: schemes differ by what they do, not by their luck.
    simulate(
        context,
        context.stream("cfwmd-linear"),
        setting.trials,
        (world, messages),
        &schemes,
        |stream| experiment.draw(stream),
        |scheme, draws, stream| experiment.trial(*scheme, draws, stream.named("scheme")),
    )
}

/// Repetitions of a timed run; the best is kept, as others share the machine.
const REPETITIONS: usize = 5;

/// Seconds of one step of each scheme, the sensors' comparisons included and the experiment's draws excluded.
pub(super) fn time_of_steps(
    context: &Context<'_>,
    setting: &Linear,
    messages: f64,
    schemes: &[(&'static str, Scheme)],
) -> Result<Vec<(&'static str, f64)>, Error> {
    match setting.noise_variances.len() {
        1 => time::<1>(context, setting, messages, schemes),
        _ => time::<2>(context, setting, messages, schemes),
    }
}

fn time<const M: usize>(
    context: &Context<'_>,
    setting: &Linear,
    messages: f64,
    schemes: &[(&'static str, Scheme)],
) -> Result<Vec<(&'static str, f64)>, Error>
where
    Measured: Dimension<M>,
{
    let experiment = Experiment::<M>::new(context, setting, messages, schemes)?;
    let stream = context.stream("cfwmd-linear");
    let draws = (0..20).map(|trial| experiment.draw(stream.indexed(trial)));
    let draws = draws.collect::<Result<Vec<_>, _>>()?;
    let mut times = Vec::new();
    for (name, scheme) in schemes.iter().filter(|(_, s)| M == 1 || !s.needs_scalars()) {
        let mut best = f64::INFINITY;
        for _ in 0..REPETITIONS {
            let started = Instant::now();
            for draws in &draws {
                black_box(experiment.trial(*scheme, draws, stream.named("scheme"))?);
            }
            best = best.min(started.elapsed().as_secs_f64() / (draws.len() * experiment.steps) as f64);
        }
        times.push((*name, best));
    }
    Ok(times)
}

impl Dimension<1> for Measured {
    fn sensor(variances: &[f64]) -> Result<LinearSensor<2, 1>, Error> {
        let variance = variances.first().copied().unwrap_or(0.0);
        Ok(LinearSensor::scalar(Vector2::new(1.0, 0.0), variance)?)
    }

    fn special(experiment: &Experiment<1>, scheme: Scheme, mut track: Track<'_, 1>) -> Result<(), Error> {
        match scheme {
            Scheme::RaoBlackwell(count) => experiment.rao_blackwell(&mut track, count),
            Scheme::Trigger(weighing) => experiment.trigger(&mut track, weighing),
            _ => experiment.heuristic(&mut track, scheme == Scheme::Centred),
        }
    }
}

impl Dimension<2> for Measured {
    fn sensor(variances: &[f64]) -> Result<LinearSensor<2, 2>, Error> {
        if variances.len() != 2 {
            let got = format!("{} numbers", variances.len());
            return Err(fewbits_numerics::ArgumentError::new("noise_variances", got, "2 variances").into());
        }
        let covariance = SMatrix::<f64, 2, 2>::from_diagonal(&Vector2::from_column_slice(variances));
        Ok(LinearSensor::new(SMatrix::identity(), covariance)?)
    }

    fn special(_: &Experiment<2>, scheme: Scheme, _: Track<'_, 2>) -> Result<(), Error> {
        Err(Error::Table(format!("{scheme:?} exists for scalar measurements only")))
    }
}
