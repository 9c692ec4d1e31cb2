//! Noise of each sensor and process noise of a level, found together from a stretch of recorded values.
//!
//! ```text
//! p(all values | process noise, noise of each sensor) by the Kalman filter of the level, which every sensor measures
//! each value is wild with probability 1/500, and then anywhere between the smallest and the largest value: it hardly moves the filter
//! the level jumps with probability 1/1000 at an instant: both beliefs are carried until the readings decide
//! maximum: first the process noise and one noise of all sensors, then each number by itself, again and again;
//!          of more than 20 sensors the noise of each from its own readings, given the level that the others say
//! ```
//! The density of a value is proper, wild values included. Numbers that are too small are therefore punished by every value that they make
//! wild. Offsets of sensors are another question: [`offsets`].

mod jumps;
mod many;
mod offsets;
mod on_grid;
mod open;
mod reading;
mod search;

pub(crate) use jumps::{Beliefs, InstantLikelihood};
pub use offsets::{median, offsets, shift_deviation};
pub use open::Openness;
pub use reading::Reading;
pub use search::Number;

use crate::{Error, assumed_density};
use fewbits_core::circle::nearest;
use fewbits_core::{Evolution, Gaussian, GaussianDynamics};
use fewbits_numerics::error::{finite, refuse};
use nalgebra::SMatrix;
use search::Search;

/// Assumed share of wild values.
const WILD: f64 = 0.002;
/// Steps of the search, in `ln`.
const STEPS: [f64; 6] = [2.0, 1.0, 0.5, 0.25, 0.1, 0.03];
/// Rounds over the single numbers.
const ROUNDS: usize = 3;
/// A sensor with fewer values than this has the noise that all have together.
const MIN_READINGS: usize = 12;

/// The readings of one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Instant {
    /// Time in seconds, not before that of the instant above.
    pub seconds: f64,
    /// Index of a sensor, and what it says.
    pub values: Vec<(usize, Reading)>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Calibration {
    /// The number on which the dynamics depend.
    pub change: f64,
    /// Standard deviation of the noise of each sensor.
    pub noises: Vec<f64>,
    /// `ln p` of all values.
    pub log_likelihood: f64,
}

/// The level and its sensors as far as they are known. The level is coordinate 0 of the state.
#[derive(Debug, Clone, Copy)]
pub struct Level<'a, W, const D: usize> {
    /// Dynamics in continuous time for a size of change, which is found, for instance the deviation of the level after an hour.
    pub world: W,
    /// The state at the first instant.
    pub prior: &'a Gaussian<D>,
    /// Period of the level, if it is an angle: values that differ by whole periods are equal.
    pub period: Option<f64>,
}

/// The belief of the level before a reading, and the probability that the reading is right.
struct Forecast {
    mean: f64,
    variance: f64,
    right: f64,
}

/// Adds the square of a distance to the variance of the level.
fn widen<const D: usize>(belief: &mut Gaussian<D>, distance: f64) {
    let mut covariance = *belief.covariance();
    covariance[(0, 0)] += distance * distance;
    *belief = Gaussian::from_trusted_parts(*belief.mean(), covariance);
}

/// Dynamics from instant to instant. Most steps are as long as the one before.
struct Steps<'a, E, const D: usize> {
    world: &'a E,
    now: f64,
    last: Option<(f64, Box<dyn GaussianDynamics<D> + 'a>)>,
}

impl<'a, E: Evolution<D>, const D: usize> Steps<'a, E, D> {
    fn new(world: &'a E, now: f64) -> Self {
        Self { world, now, last: None }
    }

    /// Dynamics up to the next instant, unless it is at the same time.
    fn to(&mut self, seconds: f64) -> Result<Option<&dyn GaussianDynamics<D>>, Error> {
        let length = seconds - self.now;
        self.now = seconds;
        if length <= 0.0 {
            return Ok(None);
        }
        if self.last.as_ref().is_none_or(|(last, _)| *last != length) {
            self.last = Some((length, self.world.over(length)?));
        }
        Ok(self.last.as_ref().map(|(_, step)| &**step))
    }
}

/// The difference of two angles, at most half a period in size.
pub fn wrapped(difference: f64, period: Option<f64>) -> f64 {
    period.map_or(difference, |period| nearest(difference, 0.0, period))
}

impl<W, E, const D: usize> Level<'_, W, D>
where
    W: Fn(f64) -> Result<E, Error>,
    E: Evolution<D>,
{
    /// Finds the unknown numbers by maximum likelihood. The belief is a Gaussian with the moments of what was said.
    ///
    /// # Errors
    /// If an instant is before the one above it, names a sensor that `noises` does not have, or holds a value that is not finite; if a number
    /// or a guess is not positive; if all values are equal.
    pub fn calibrate(&self, instants: &[Instant], change: Number, noises: &[Number]) -> Result<Calibration, Error> {
        self.search(instants, change, noises, Self::log_likelihood, true)
    }

    /// Number of readings of each sensor, and the range of all.
    fn checked(&self, instants: &[Instant], change: Number, noises: &[Number]) -> Result<(Vec<usize>, f64), Error> {
        change.check("change")?;
        noises.iter().try_for_each(|noise| noise.check("noises"))?;
        let mut counts = vec![0_usize; noises.len()];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for instant in instants {
            finite("seconds", instant.seconds)?;
        }
        for (sensor, reading) in instants.iter().flat_map(|instant| &instant.values) {
            reading.check()?;
            let Some(count) = counts.get_mut(*sensor) else {
                return refuse("sensor", sensor, format!("below {}, the number of noises", noises.len()));
            };
            *count += 1;
            for number in reading.numbers() {
                (low, high) = (low.min(number), high.max(number));
            }
        }
        let is_wide = high > low;
        if !is_wide {
            return refuse("values", "all equal", "values that vary");
        }
        if let Some(pair) = instants.windows(2).find(|pair| pair[1].seconds < pair[0].seconds) {
            return refuse("seconds", pair[1].seconds, format!("{} or later", pair[0].seconds));
        }
        Ok((counts, self.period.unwrap_or(high - low)))
    }

    /// The search by a likelihood of all instants, given the range of the values, the change and the noises. `is_gaussian`: so that each of many
    /// sensors can be found beside the others.
    fn search(
        &self,
        instants: &[Instant],
        change: Number,
        noises: &[Number],
        log_likelihood: impl Fn(&Self, &[Instant], f64, f64, &[f64]) -> Option<f64>,
        is_gaussian: bool,
    ) -> Result<Calibration, Error> {
        let (counts, range) = self.checked(instants, change, noises)?;
        let log_likelihood = |change: f64, noises: &[f64]| {
            let found = log_likelihood(self, instants, range, change, noises);
            found.unwrap_or(f64::NEG_INFINITY)
        };
        let mut found = Search {
            change,
            noises,
            shifts: vec![0.0; noises.len() + 1],
            best: f64::NEG_INFINITY,
            log_likelihood,
        };
        found.best = found.at(&found.shifts);
        // One noise of all sensors first, so that few numbers begin near the maximum.
        let together: Vec<usize> = (1..=noises.len())
            .filter(|axis| noises[axis - 1].is_unknown())
            .collect();
        let own_change: Vec<usize> = change.is_unknown().then_some(0).into_iter().collect();
        // Where values that are sent seldom are all taken for wild, the likelihood has a second maximum.
        if change.is_unknown() {
            found.scan();
        }
        found.improve(&[own_change.clone(), together.clone()], &STEPS);
        let number = |number: &Number, shift: f64| number.at(shift).unwrap_or(number.start());
        let numbers = |shifts: &[f64]| -> Vec<f64> {
            let all = noises.iter().zip(&shifts[1..]);
            all.map(|(one, shift)| number(one, *shift)).collect()
        };
        let others = |shifts: &[f64]| match is_gaussian {
            true => self.others(instants, range, number(&change, shifts[0]), &numbers(shifts)),
            false => None,
        };
        let mut own: Vec<usize> = together.clone();
        own.retain(|axis| counts[*axis - 1] >= MIN_READINGS);
        let single: Vec<Vec<usize>> = own.iter().map(|axis| vec![*axis]).chain([own_change.clone()]).collect();
        for _ in 0..ROUNDS {
            let before = found.best;
            match others(&found.shifts) {
                Some(others) => {
                    let shifts = found.shifts.clone();
                    for axis in &own {
                        let mut one = self.one(&others, noises, *axis, range, shifts[*axis]);
                        one.improve(&[vec![1]], &STEPS[1..]);
                        found.shifts[*axis] = one.shifts[1];
                    }
                    found.best = found.at(&found.shifts);
                    if found.best < before {
                        (found.best, found.shifts) = (before, shifts);
                    }
                    found.improve(std::slice::from_ref(&own_change), &STEPS[1..]);
                }
                None => found.improve(&single, &STEPS[1..]),
            }
            if found.best - before < 1e-3 {
                break;
            }
        }
        match others(&found.shifts) {
            Some(others) => {
                for axis in &together {
                    let mut one = self.one(&others, noises, *axis, range, found.shifts[*axis]);
                    one.settle(1);
                    found.shifts[*axis] = one.shifts[1];
                }
            }
            None => together.iter().for_each(|axis| found.settle(*axis)),
        }
        if change.is_unknown() {
            found.settle(0);
        }
        Ok(Calibration {
            change: number(&change, found.shifts[0]),
            noises: numbers(&found.shifts),
            log_likelihood: found.best,
        })
    }

    fn log_likelihood(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Option<f64> {
        Some(self.pass(instants, range, change, noises)?.0)
    }

    /// `ln p` of all readings, and the mean over the instants of the logarithm of the level's deviation given the readings up to each.
    fn pass(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Option<(f64, f64)> {
        let world = (self.world)(change).ok()?;
        let mut beliefs = Beliefs::new(*self.prior);
        let (mut total, mut deviations) = (0.0, 0.0);
        let mut steps = Steps::new(&world, instants.first()?.seconds);
        for instant in instants {
            if let Some(step) = steps.to(instant.seconds).ok()? {
                let predict = |belief: &mut Gaussian<D>| {
                    *belief = assumed_density::predict(step, belief);
                    Ok(())
                };
                beliefs.predict::<()>(predict).ok()?;
            }
            let update = |belief: &mut Gaussian<D>| self.updated(belief, instant, range, noises, |_| ()).ok_or(());
            let widen = |belief: &mut Gaussian<D>, distance: f64| {
                widen(belief, distance);
                Ok(())
            };
            total += beliefs.update(instant.seconds, update, widen).ok()?.0;
            deviations += 0.5 * beliefs.main().covariance()[(0, 0)].ln();
        }
        (!total.is_nan()).then_some((total, deviations / instants.len() as f64))
    }

    /// Takes in the readings of an instant; `None` if numbers run out of range. `each`: the belief of the level before a reading, and the probability
    /// that it is right.
    fn updated(
        &self,
        belief: &mut Gaussian<D>,
        instant: &Instant,
        range: f64,
        noises: &[f64],
        mut each: impl FnMut(Forecast),
    ) -> Option<InstantLikelihood> {
        let (mut log_density, mut farthest, mut doubt) = (0.0, 0.0_f64, 0.0_f64);
        for (sensor, reading) in &instant.values {
            let (mean, covariance) = (*belief.mean(), *belief.covariance());
            let said = reading.said(mean[0], covariance[(0, 0)], noises[*sensor], self.period)?;
            let deviation = said.variance.sqrt();
            let doubted = said.doubted(WILD, reading.wild(WILD, range));
            each(Forecast {
                mean: mean[0],
                variance: covariance[(0, 0)],
                right: doubted.right,
            });
            log_density += doubted.density.ln();
            doubt = doubt.max(1.0 - doubted.right);
            farthest = farthest.max((said.score * deviation).abs());
            let gain = covariance.column(0) / deviation;
            let next: SMatrix<f64, D, D> = covariance - gain * gain.transpose() * doubted.spread;
            *belief = Gaussian::from_trusted_parts(mean + gain * doubted.score, next);
        }
        Some(InstantLikelihood {
            log_density,
            farthest,
            doubt,
        })
    }
}
