//! Noise of each sensor and process noise of a level, found together from a stretch of recorded values.
//!
//! ```text
//! p(all values | process noise, noise of each sensor) by the Kalman filter of the level, which every sensor measures
//! each value is wild with probability 1/500, and then anywhere between the smallest and the largest value: it hardly moves the filter
//! maximum: first the process noise and one noise of all sensors, then each number by itself, again and again
//! ```
//! The density of a value is proper, wild values included. Numbers that are too small are therefore punished by every value that they make
//! wild. Offsets of sensors are another question: [`offsets`].

mod offsets;
mod on_grid;
mod reading;

pub use offsets::{median, offsets, shift_deviation};
pub use reading::Reading;

use crate::{Error, assumed_density};
use fewbits_core::{Evolution, Gaussian, GaussianDynamics};
use fewbits_numerics::error::{finite, positive, refuse};
use nalgebra::SMatrix;

/// Assumed share of wild values.
const WILD: f64 = 0.002;
/// Instants in a row without a value that agrees with the prediction after which the level is taken to have jumped; also so many wild values of one
/// sensor in a row, if the others are likelier where it says that the level is.
const JUMP: u32 = 4;
/// Steps of the search, in `ln`, and its reach about the start.
const STEPS: [f64; 6] = [2.0, 1.0, 0.5, 0.25, 0.1, 0.03];
const REACH: f64 = 9.0;
/// How far the first scan of the change reaches.
const SCANNED: i32 = 6;
/// Rounds over the single numbers.
const ROUNDS: usize = 3;
/// A number is raised by these steps while the likelihood, which is as high (within so many nats) so far below, loses little.
const FAR_BELOW: f64 = 2.0;
const AS_HIGH: f64 = 0.2;
const RAISED: f64 = 0.25;
const LITTLE: f64 = 1.0;
/// Steps of the mean over a number, in `ln`, and how many to either side.
const SETTLED: f64 = 0.125;
const FAR: i32 = 16;
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

/// A standard deviation or a factor: known, or to be found from a first guess.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// It is held fixed.
    Known(f64),
    /// It is found.
    Unknown {
        /// First guess.
        guess: f64,
        /// Smallest number that is considered, for instance because values are rounded.
        least: f64,
    },
}

impl Number {
    fn check(&self, name: &'static str) -> Result<(), Error> {
        match self {
            Self::Known(number) => positive(name, *number)?,
            Self::Unknown { guess, least } => {
                finite(name, *least)?;
                positive(name, *guess)?
            }
        };
        Ok(())
    }

    fn start(&self) -> f64 {
        match self {
            Self::Known(number) => *number,
            Self::Unknown { guess, least } => guess.max(*least),
        }
    }

    /// The number at `ln` this far from the start; `None` if it is out of reach.
    fn at(&self, shift: f64) -> Option<f64> {
        match self {
            Self::Known(number) => Some(*number),
            Self::Unknown { least, .. } => {
                let number = self.start() * shift.exp();
                (shift.abs() <= REACH && number >= *least).then_some(number)
            }
        }
    }

    fn is_unknown(&self) -> bool {
        matches!(self, Self::Unknown { .. })
    }
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

/// The difference of two angles, at most half a period in size.
pub fn wrapped(difference: f64, period: Option<f64>) -> f64 {
    period.map_or(difference, |period| difference - period * (difference / period).round())
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
        self.search(instants, change, noises, Self::log_likelihood)
    }

    /// The search by a likelihood of all instants, given the range of the values, the change and the noises.
    fn search(
        &self,
        instants: &[Instant],
        change: Number,
        noises: &[Number],
        log_likelihood: impl Fn(&Self, &[Instant], f64, f64, &[f64]) -> Option<f64>,
    ) -> Result<Calibration, Error> {
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
        let range = self.period.unwrap_or(high - low);
        if let Some(pair) = instants.windows(2).find(|pair| pair[1].seconds < pair[0].seconds) {
            return refuse("seconds", pair[1].seconds, format!("{} or later", pair[0].seconds));
        }
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
        let single: Vec<Vec<usize>> = together
            .iter()
            .filter(|axis| counts[**axis - 1] >= MIN_READINGS)
            .map(|axis| vec![*axis])
            .chain([own_change])
            .collect();
        for _ in 0..ROUNDS {
            let before = found.best;
            found.improve(&single, &STEPS[1..]);
            if found.best - before < 1e-3 {
                break;
            }
        }
        for axis in together.iter().chain(change.is_unknown().then_some(&0)) {
            found.settle(*axis);
        }
        let number = |number: &Number, shift: f64| number.at(shift).unwrap_or(number.start());
        Ok(Calibration {
            change: number(&change, found.shifts[0]),
            noises: noises
                .iter()
                .zip(&found.shifts[1..])
                .map(|(one, shift)| number(one, *shift))
                .collect(),
            log_likelihood: found.best,
        })
    }

    fn log_likelihood(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Option<f64> {
        let world = (self.world)(change).ok()?;
        let (mut belief, mut total, mut astray) = (*self.prior, 0.0, 0);
        let mut alone = vec![(0, 0.0); noises.len()];
        let mut now = instants.first()?.seconds;
        // Most steps are as long as the one before.
        let mut step: Option<(f64, Box<dyn GaussianDynamics<D> + '_>)> = None;
        for instant in instants {
            let seconds = instant.seconds - now;
            now = instant.seconds;
            if seconds > 0.0 {
                if step.as_ref().is_none_or(|(length, _)| *length != seconds) {
                    step = Some((seconds, world.over(seconds).ok()?));
                }
                if let Some((_, step)) = &step {
                    belief = assumed_density::predict(&**step, &belief);
                }
            }
            let (mut agreeing, mut farthest, mut has_jumped) = (0.0, 0.0_f64, false);
            let predicted = belief.mean()[0];
            for (sensor, reading) in &instant.values {
                let (mean, covariance) = (*belief.mean(), *belief.covariance());
                let said = reading.said(mean[0], covariance[(0, 0)], noises[*sensor], self.period)?;
                let deviation = said.variance.sqrt();
                let (right, wild) = ((1.0 - WILD) * said.density, reading.wild(WILD, range));
                total += (right + wild).ln();
                // The moments of the mixture of "it is wild" and "it is not".
                let weight = right / (right + wild);
                agreeing += weight;
                let (in_row, votes) = &mut alone[*sensor];
                if weight > 0.5 {
                    (*in_row, *votes) = (0, 0.0);
                } else if let Some(level) = reading.middle() {
                    *in_row += 1;
                    *votes += self.votes(*sensor, level, predicted, noises, &instant.values);
                    has_jumped |= *in_row >= JUMP && *votes > 0.0;
                }
                farthest = farthest.max((said.score * deviation).abs());
                let gain = covariance.column(0) / deviation;
                let off = said.score * said.score;
                let spread = weight * ((1.0 - said.left) - (1.0 - weight) * off);
                let next: SMatrix<f64, D, D> = covariance - gain * gain.transpose() * spread;
                belief = Gaussian::from_trusted_parts(mean + gain * (weight * said.score), next);
            }
            astray = if instant.values.is_empty() || agreeing > 0.5 {
                0
            } else {
                astray + 1
            };
            if astray >= JUMP || has_jumped {
                let mut covariance = *belief.covariance();
                covariance[(0, 0)] += farthest * farthest;
                belief = Gaussian::from_trusted_parts(*belief.mean(), covariance);
                astray = 0;
                alone.fill((0, 0.0));
            }
        }
        (!total.is_nan()).then_some(total)
    }

    /// What the other readings of an instant say of one that is wild: how much likelier they are if the level is where it is than where it was
    /// predicted, in nats. Those of sensors that are much less accurate than the prediction agree with it wherever the level is.
    fn votes(&self, own: usize, level: f64, predicted: f64, noises: &[f64], readings: &[(usize, Reading)]) -> f64 {
        let log = |sensor: usize, reading: &Reading, level: f64| {
            let said = reading.said(level, 0.0, noises[sensor], self.period);
            said.map_or(f64::MIN_POSITIVE, |said| said.density.max(f64::MIN_POSITIVE))
                .ln()
        };
        let others = readings.iter().filter(|(sensor, _)| *sensor != own);
        others
            .map(|(sensor, reading)| log(*sensor, reading, level) - log(*sensor, reading, predicted))
            .sum()
    }
}

/// A search along groups of numbers that move together, in `ln`.
struct Search<'a, L> {
    change: Number,
    noises: &'a [Number],
    /// Of the change, then of each noise.
    shifts: Vec<f64>,
    best: f64,
    log_likelihood: L,
}

impl<L: Fn(f64, &[f64]) -> f64> Search<'_, L> {
    fn at(&self, shifts: &[f64]) -> f64 {
        let noises: Option<Vec<f64>> = self
            .noises
            .iter()
            .zip(&shifts[1..])
            .map(|(one, shift)| one.at(*shift))
            .collect();
        match (self.change.at(shifts[0]), noises) {
            (Some(change), Some(noises)) => (self.log_likelihood)(change, &noises),
            _ => f64::NEG_INFINITY,
        }
    }

    /// Replaces a number by the root of the mean of its square under its likelihood, the other numbers held: what may as well be smaller or larger
    /// makes bands too narrow more than too wide. Where the likelihood is as high far below, it says nothing but an upper end, and the largest number
    /// that is not improbable is taken.
    fn settle(&mut self, axis: usize) {
        let moved = |by: f64| {
            let mut other = self.shifts.clone();
            other[axis] += by;
            other
        };
        let number = if axis == 0 {
            &self.change
        } else {
            &self.noises[axis - 1]
        };
        // Not below the least number that is considered.
        let room = match number {
            Number::Unknown { least, .. } if *least > 0.0 => self.shifts[axis] - (least / number.start()).ln(),
            _ => FAR_BELOW,
        };
        // Nor out of the reach of the search, where it ends if the number hardly matters.
        let down = FAR_BELOW.min(room).min(REACH + self.shifts[axis]);
        let here = self.at(&self.shifts);
        // At the least number it is as small as it may be.
        let is_flat = down < RAISED || self.at(&moved(-down)) >= here - AS_HIGH * down / FAR_BELOW;
        if !is_flat {
            let (mut sum, mut squares) = (0.0, 0.0);
            for k in -FAR..=FAR {
                let by = SETTLED * f64::from(k);
                let weight = (self.at(&moved(by)) - here).exp();
                sum += weight;
                squares += weight * (2.0 * by).exp();
            }
            let by = 0.5 * (squares / sum).ln();
            if by.is_finite() && self.at(&moved(by)).is_finite() {
                self.shifts[axis] += by;
            }
            return;
        }
        let mut by = 0.0;
        while by < REACH && self.at(&moved(by + RAISED)) > here - LITTLE {
            by += RAISED;
        }
        // What no reading depends on stays as it is.
        if by < REACH {
            self.shifts[axis] += by;
        }
    }

    /// Begins at the best of some changes that are factors of e apart.
    fn scan(&mut self) {
        let start = self.shifts.clone();
        for k in -SCANNED..=SCANNED {
            let mut other = start.clone();
            other[0] += f64::from(k);
            let found = self.at(&other);
            if found > self.best {
                (self.best, self.shifts) = (found, other);
            }
        }
    }

    /// Moves along each group, with smaller and smaller steps.
    fn improve(&mut self, groups: &[Vec<usize>], steps: &[f64]) {
        for step in steps {
            loop {
                let before = self.best;
                for group in groups.iter().filter(|group| !group.is_empty()) {
                    for sign in [-step, *step] {
                        let mut other = self.shifts.clone();
                        group.iter().for_each(|axis| other[*axis] += sign);
                        let found = self.at(&other);
                        if found > self.best {
                            (self.best, self.shifts) = (found, other);
                        }
                    }
                }
                let has_risen = self.best > before;
                if !has_risen {
                    break;
                }
            }
        }
    }
}
