//! The likelihood of a scalar level that silence cuts again and again: its belief is no Gaussian, and that of the same moments finds other numbers.

use super::{Beliefs, Calibration, Instant, InstantLikelihood, Level, Number, Reading, Steps, WILD};
use crate::Error;
use crate::moving_grid::{QUICK, mixed, predicted, start, updated};
use fewbits_core::{Belief, Evolution, Gaussian, Likelihood};
use fewbits_densities::PointMass;
use nalgebra::Vector1;

/// A reading narrower than so many distances between nodes is taken in by itself: beside the chance that it is wild, the nodes do not show where the
/// level is if it is right.
const NARROW: f64 = 2.0;
/// Standard deviation of what a node stands for, in distances between nodes: it is added to the noise of other readings, whose ends lie between nodes.
const SMEARED: f64 = 0.289;
/// The smaller of two shares of a mixture is left out below this.
const NEGLIGIBLE: f64 = 1e-6;

/// A reading of a level, which is wild with a small probability.
struct Doubted<'a> {
    reading: &'a Reading,
    noise: f64,
    period: Option<f64>,
    wild: f64,
}

impl Doubted<'_> {
    fn log_right(&self, level: f64) -> f64 {
        (1.0 - WILD).ln() + self.reading.log_given(level, self.noise, self.period)
    }

    /// The belief after a reading that is narrow: that of a right reading on a grid as fine as it takes, and the belief before it.
    fn narrow(&self, belief: PointMass) -> Result<(PointMass, f64), Error> {
        let (right, log_right) = updated(&belief, &[&Right(self)], &QUICK)?;
        let log_wild = self.wild.ln();
        let largest = log_right.max(log_wild);
        let log_likelihood = largest + ((log_right - largest).exp() + (log_wild - largest).exp()).ln();
        let share = (log_right - log_likelihood).exp();
        let next = if share < NEGLIGIBLE {
            belief
        } else if 1.0 - share < NEGLIGIBLE {
            right
        } else {
            mixed(&right, &belief, share)?
        };
        Ok((next, log_likelihood))
    }
}

impl Likelihood<1> for Doubted<'_> {
    fn log_likelihood(&self, level: &Vector1<f64>) -> f64 {
        (self.log_right(level[0]).exp() + self.wild).ln()
    }
}

/// A reading that is not wild.
struct Right<'a>(&'a Doubted<'a>);

impl Likelihood<1> for Right<'_> {
    fn log_likelihood(&self, level: &Vector1<f64>) -> f64 {
        self.0.log_right(level[0])
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
        let log_likelihood = |level: &Self, instants: &[Instant], range: f64, change: f64, noises: &[f64]| {
            level.on_grid(instants, range, change, noises).ok().flatten()
        };
        self.search(instants, change, noises, log_likelihood, false)
    }

    fn on_grid(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Result<Option<f64>, Error> {
        let world = (self.world)(change)?;
        let mut beliefs = Beliefs::new(start(self.prior, &QUICK)?);
        let mut total = 0.0;
        let mut steps = Steps::new(&world, instants.first().map_or(0.0, |instant| instant.seconds));
        for instant in instants {
            if let Some(step) = steps.to(instant.seconds)? {
                beliefs.predict(|belief| {
                    *belief = predicted(belief, step, &QUICK)?;
                    Ok::<(), Error>(())
                })?;
            }
            if instant.values.is_empty() {
                continue;
            }
            let update = |belief: &mut PointMass| self.updated_on_grid(belief, instant, range, noises);
            let widen = |belief: &mut PointMass, distance: f64| {
                let (level, variance) = (Belief::mean(belief)[0], Belief::covariance(belief)[0]);
                *belief = start(&Gaussian::scalar(level, variance + distance * distance)?, &QUICK)?;
                Ok(())
            };
            total += beliefs.update(instant.seconds, update, widen)?.0;
        }
        Ok((!total.is_nan()).then_some(total))
    }

    fn updated_on_grid(
        &self,
        belief: &mut PointMass,
        instant: &Instant,
        range: f64,
        noises: &[f64],
    ) -> Result<InstantLikelihood, Error> {
        let mut readings: Vec<Doubted<'_>> = instant
            .values
            .iter()
            .map(|(sensor, reading)| Doubted {
                reading,
                noise: noises[*sensor],
                period: self.period,
                wild: reading.wild(WILD, range),
            })
            .collect();
        let expected = Belief::mean(belief)[0];
        let mut log_density = 0.0;
        let mut wide: Vec<&dyn Likelihood<1>> = Vec::new();
        for one in &mut readings {
            let spacing = belief.grid().spacing();
            if one.reading.width(one.noise) < NARROW * spacing {
                let (next, log_likelihood) = one.narrow(belief.clone())?;
                *belief = next;
                log_density += log_likelihood;
            } else {
                one.noise = one.noise.hypot(SMEARED * spacing);
                wide.push(one);
            }
        }
        if !wide.is_empty() {
            let (next, log_likelihood) = updated(belief, &wide, &QUICK)?;
            *belief = next;
            log_density += log_likelihood;
        }
        let level = Belief::mean(belief)[0];
        let wild = |one: &Doubted<'_>| 1.0 / (1.0 + (one.log_right(level) - one.wild.ln()).exp());
        let doubt = readings.iter().map(wild).fold(0.0, f64::max);
        let values = instant.values.iter().filter_map(|(_, reading)| reading.middle());
        let farthest = values.map(|value| (value - expected).abs()).fold(0.0, f64::max);
        Ok(InstantLikelihood {
            log_density,
            farthest,
            doubt,
        })
    }
}
