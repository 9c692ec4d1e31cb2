//! The likelihood of a scalar level that silence cuts again and again: its belief is no Gaussian, and that of the same moments finds other numbers.

use super::{Calibration, Instant, JUMP, Level, Number, Reading, WILD};
use crate::Error;
use crate::moving_grid::{QUICK, predicted, start, updated};
use fewbits_core::{Belief, Evolution, Gaussian, GaussianDynamics, Likelihood};
use nalgebra::Vector1;

/// A reading of a level, which is wild with a small probability.
struct Said<'a> {
    reading: &'a Reading,
    noise: f64,
    period: Option<f64>,
    wild: f64,
}

impl Said<'_> {
    fn right(&self, level: f64) -> f64 {
        (1.0 - WILD) * self.reading.given(level, self.noise, self.period)
    }
}

impl Likelihood<1> for Said<'_> {
    fn log_likelihood(&self, level: &Vector1<f64>) -> f64 {
        (self.right(level[0]) + self.wild).ln()
    }
}

impl<W, E> Level<'_, W, 1>
where
    W: Fn(f64) -> Result<E, Error>,
    E: Evolution<1>,
{
    /// As [`calibrate`](Self::calibrate), with the belief on a grid: for readings that say again and again that the level lies between two ends, so
    /// that it is far from a Gaussian. It takes some hundred times as long.
    ///
    /// # Errors
    /// As there.
    pub fn calibrate_on_grid(
        &self,
        instants: &[Instant],
        change: Number,
        noises: &[Number],
    ) -> Result<Calibration, Error> {
        self.search(instants, change, noises, |level, instants, range, change, noises| {
            level.on_grid(instants, range, change, noises).ok().flatten()
        })
    }

    fn on_grid(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Result<Option<f64>, Error> {
        let world = (self.world)(change)?;
        let mut belief = start(self.prior, &QUICK)?;
        let (mut total, mut astray) = (0.0, 0);
        let mut now = instants.first().map_or(0.0, |instant| instant.seconds);
        let mut step: Option<(f64, Box<dyn GaussianDynamics<1> + '_>)> = None;
        for instant in instants {
            let seconds = instant.seconds - now;
            now = instant.seconds;
            if seconds > 0.0 {
                if step.as_ref().is_none_or(|(length, _)| *length != seconds) {
                    step = Some((seconds, world.over(seconds)?));
                }
                if let Some((_, step)) = &step {
                    belief = predicted(&belief, &**step, &QUICK)?;
                }
            }
            if instant.values.is_empty() {
                continue;
            }
            let said: Vec<Said<'_>> = instant
                .values
                .iter()
                .map(|(sensor, reading)| Said {
                    reading,
                    noise: noises[*sensor],
                    period: self.period,
                    wild: reading.wild(WILD, range),
                })
                .collect();
            let observed: Vec<&dyn Likelihood<1>> = said.iter().map(|one| one as &dyn Likelihood<1>).collect();
            let expected = Belief::mean(&belief)[0];
            let (next, log_likelihood) = updated(&belief, &observed, &QUICK)?;
            belief = next;
            total += log_likelihood;
            let level = Belief::mean(&belief)[0];
            let agrees = said.iter().any(|one| one.right(level) > one.wild);
            astray = if agrees { 0 } else { astray + 1 };
            if astray >= JUMP {
                let values = instant.values.iter().filter_map(|(_, reading)| reading.middle());
                let farthest = values.map(|value| (value - expected).abs()).fold(0.0, f64::max);
                let variance = Belief::covariance(&belief)[0] + farthest * farthest;
                belief = start(&Gaussian::scalar(level, variance)?, &QUICK)?;
                astray = 0;
            }
        }
        Ok((!total.is_nan()).then_some(total))
    }
}
