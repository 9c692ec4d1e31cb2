//! Concentrations that change with time.

pub use crate::stepper::Method;

use crate::solver::Direction;
use crate::stepper::{State, Stepper};
use crate::{Error, Patch, Transport};
use faer::Mat;
use fewbits_numerics::error::{all_finite, at_least_one, positive, refuse};

/// Control of the step lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepControl {
    /// The estimated error of a step, relative to the largest concentration, stays below this number. Step lengths change by factors of
    /// two.
    Tolerance(f64),
    /// This many equal steps in every interval between successive starts, stops and output times.
    Equal(usize),
}

impl Default for StepControl {
    fn default() -> Self {
        Self::Tolerance(1e-6)
    }
}

/// A release from `start` to `stop`, s. `stop` may be infinite.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedSource {
    /// Where it releases.
    pub patch: Patch,
    /// Its rate, kg/s.
    pub rate: f64,
    /// When it starts, s.
    pub start: f64,
    /// When it stops, s.
    pub stop: f64,
}

/// The field at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// The instant, s.
    pub time: f64,
    /// Concentration in each free cell, kg/m^3.
    pub concentration: Vec<f64>,
    /// Integral of the concentration over time since 0, kg s/m^3. [`Transport::balance`] of it says how much has left, and how.
    pub dose: Vec<f64>,
    /// The lowest concentration so far. It is negative only by errors of the time steps.
    pub lowest: f64,
    /// Steps so far.
    pub steps: usize,
}

/// Solves a transport in time.
///
/// ```text
/// intervals end at every start, stop and asked instant
/// in each: step = interval / 2^k, halved while the error exceeds the tolerance, doubled while it is far below
/// one factorisation of V + w step A for each length of step; the last ones used are kept
/// ```
pub struct Transient<'a> {
    stepper: Stepper<'a>,
    control: StepControl,
}

/// Steps shorter than `2^-45` of the interval no longer change the time.
const MIN_SHARE_EXPONENT: i32 = -45;
/// Largest number of steps of an interval: rounding may keep the error just below the tolerance however short the steps are.
const MAX_STEPS: usize = 200_000;
/// Largest number of common units in all intervals together.
const MAX_UNITS: f64 = 65536.0;
/// A step is doubled if its error is below the tolerance divided by this: doubling multiplies the error by eight, and two is a margin.
const DOUBLING_MARGIN: f64 = 16.0;

impl<'a> Transient<'a> {
    /// A solver with TR-BDF2 and the default tolerance.
    pub fn new(transport: &'a Transport) -> Self {
        Self {
            stepper: Stepper::new(transport),
            control: StepControl::default(),
        }
    }

    /// The same solver with another method.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        self.stepper.method = method;
        self
    }

    /// The same solver with another step control.
    ///
    /// # Errors
    /// If the tolerance is not a positive number, or the number of steps is zero.
    pub fn with_control(self, control: StepControl) -> Result<Self, Error> {
        match control {
            StepControl::Tolerance(tolerance) => positive("tolerance", tolerance).map(|_| ())?,
            StepControl::Equal(steps) => at_least_one("steps", steps).map(|_| ())?,
        }
        Ok(Self { control, ..self })
    }

    /// The field at the given times (s, increasing, after 0), starting from the concentrations `initial` at time 0.
    ///
    /// # Errors
    /// If `initial` has not one number for each free cell, instants do not increase from above 0, a rate is not finite, a release stops
    /// before it starts or starts before 0, a patch is of another domain, a concentration is not, [`Error::Factorisation`] or [`Error::StepTooSmall`].
    pub fn run(&mut self, initial: &[f64], releases: &[TimedSource], times: &[f64]) -> Result<Vec<Snapshot>, Error> {
        let transport = self.stepper.transport;
        transport.check_field("initial", initial)?;
        check_instants("times", times)?;
        let last = times.last().copied().unwrap_or(0.0);
        let mut instants = times.to_vec();
        for TimedSource {
            patch,
            rate,
            start,
            stop,
        } in releases
        {
            // Checks rate and patch.
            transport.release(patch, *rate, &mut vec![0.0; initial.len()])?;
            if !(*start >= 0.0 && start <= stop) {
                return refuse("start, stop", format!("{start} to {stop}"), "0 <= start <= stop");
            }
            instants.extend([*start, *stop].iter().filter(|t| **t > 0.0 && **t < last));
        }
        instants.sort_by(f64::total_cmp);
        instants.dedup();
        let source = |now: f64| {
            let mut amounts = Mat::zeros(initial.len(), 1);
            for release in releases
                .iter()
                .filter(|release| release.start <= now && now < release.stop)
            {
                transport.release(&release.patch, release.rate, amounts.col_as_slice_mut(0))?;
            }
            Ok(amounts)
        };
        let initial = Mat::from_fn(initial.len(), 1, |i, _| initial[i]);
        let mut snapshots = Vec::with_capacity(times.len());
        self.march(Direction::Forward, initial, &instants, source, |time, state| {
            if times.contains(&time) {
                snapshots.push(Snapshot {
                    time,
                    concentration: state.concentration.col_as_slice(0).to_vec(),
                    dose: state.dose.col_as_slice(0).to_vec(),
                    lowest: state.lowest,
                    steps: state.steps,
                });
            }
        })?;
        Ok(snapshots)
    }

    /// The concentration that a sensor measures, kg/m^3 per kg/s, for a source in each free cell that has released for a given time (age).
    /// Indices of the result: age (s, increasing, above 0), sensor, free cell.
    ///
    /// These are adjoint steps: with [`StepControl::Equal`] they agree with [`Transient::run`] to rounding. A release from `start` to
    /// `stop` causes the difference of the responses at `time - start` and `time - stop`.
    ///
    /// # Errors
    /// If ages do not increase from above 0, a patch is of another domain, [`Error::Factorisation`] or [`Error::StepTooSmall`].
    pub fn step_responses(&mut self, sensors: &[Patch], ages: &[f64]) -> Result<Vec<Vec<Vec<f64>>>, Error> {
        check_instants("ages", ages)?;
        let source = self.stepper.transport.columns(sensors)?;
        let nothing = Mat::zeros(source.nrows(), source.ncols());
        let mut responses = Vec::with_capacity(ages.len());
        self.march(
            Direction::Adjoint,
            nothing,
            ages,
            |_| Ok(source.clone()),
            |_, state| {
                let columns = 0..sensors.len();
                responses.push(columns.map(|j| state.concentration.col_as_slice(j).to_vec()).collect());
            },
        )?;
        Ok(responses)
    }

    /// Advances columns from time 0 through the instants. `source(t)` is the constant source from `t` to the next instant. `visit` is
    /// called at each instant.
    fn march(
        &mut self,
        direction: Direction,
        initial: Mat<f64>,
        instants: &[f64],
        source: impl Fn(f64) -> Result<Mat<f64>, Error>,
        mut visit: impl FnMut(f64, &State),
    ) -> Result<(), Error> {
        let (mut state, mut before, mut now) = (State::new(initial), None, 0.0);
        let unit = common_unit(instants);
        for end in instants {
            let source = source(now)?;
            // A new source causes fast changes at first: start again with a small step.
            if before.as_ref() != Some(&source) {
                state.wanted = self.first_step(&state.concentration, &source);
            }
            self.advance(direction, &mut state, &source, end - now, unit)?;
            for j in 0..source.ncols() {
                all_finite("concentration", state.concentration.col_as_slice(j))?;
                all_finite("dose", state.dose.col_as_slice(j))?;
            }
            visit(*end, &state);
            (before, now) = (Some(source), *end);
        }
        Ok(())
    }

    /// Length of the first step: a small share of the shortest decay time among cells that hold or receive something.
    fn first_step(&self, concentration: &Mat<f64>, source: &Mat<f64>) -> f64 {
        let StepControl::Tolerance(tolerance) = self.control else {
            return f64::INFINITY;
        };
        let mut shortest = f64::INFINITY;
        for j in 0..source.ncols() {
            let pairs = concentration.col_as_slice(j).iter().zip(source.col_as_slice(j));
            for (i, _) in pairs.enumerate().filter(|(_, (c, s))| **c != 0.0 || **s != 0.0) {
                shortest = f64::min(shortest, self.stepper.transport.volumes[i] / self.stepper.transport.diagonal[i]);
            }
        }
        shortest * tolerance.cbrt()
    }

    /// Advances the columns by `duration` with a constant source.
    fn advance(
        &mut self,
        direction: Direction,
        state: &mut State,
        source: &Mat<f64>,
        duration: f64,
        unit: Option<f64>,
    ) -> Result<(), Error> {
        let tolerance = match self.control {
            StepControl::Tolerance(tolerance) => tolerance,
            StepControl::Equal(steps) => {
                let step = duration / steps as f64;
                for _ in 0..steps {
                    let (next, dose, _) = self.stepper.step(direction, &state.concentration, source, step)?;
                    state.accept(next, dose);
                }
                return Ok(());
            }
        };
        // The rest of the interval is `left` steps of `base 2^level`.
        let base = unit.unwrap_or(duration);
        let (mut left, mut level) = ((duration / base).round() as u64, 0_i32);
        let length = |level: i32| base * 2.0_f64.powi(level);
        let first = state.steps;
        while left > 0 {
            while left % 2 == 0 && length(level + 1) <= state.wanted {
                (left, level) = (left / 2, level + 1);
            }
            while length(level) > state.wanted && level > MIN_SHARE_EXPONENT {
                (left, level) = (left * 2, level - 1);
            }
            let step = length(level);
            if state.steps - first > MAX_STEPS {
                return Err(Error::StepTooSmall { step });
            }
            let (next, dose, error) = self.stepper.step(direction, &state.concentration, source, step)?;
            if error.is_nan() || error > tolerance {
                if level <= MIN_SHARE_EXPONENT {
                    return Err(Error::StepTooSmall { step });
                }
                state.wanted = 0.5 * step;
                continue;
            }
            state.accept(next, dose);
            left -= 1;
            let doubled = error < tolerance / DOUBLING_MARGIN;
            state.wanted = if doubled { 2.0 * step } else { step };
        }
        Ok(())
    }
}

fn check_instants(name: &'static str, instants: &[f64]) -> Result<(), Error> {
    all_finite(name, instants)?;
    let increasing = instants.windows(2).all(|pair| pair[0] < pair[1]);
    match instants.first() {
        Some(first) if *first > 0.0 && increasing => Ok(()),
        _ => refuse(name, format!("{instants:?}"), "one or more increasing instants after 0"),
    }
}

/// The longest time of which all intervals are multiples, so that few step lengths occur. `None` if the shortest interval has more than 64
/// of them, or all together more than [`MAX_UNITS`].
fn common_unit(instants: &[f64]) -> Option<f64> {
    let last = *instants.last()?;
    let (mut unit, mut shortest, mut before) = (0.0_f64, f64::INFINITY, 0.0);
    for end in instants {
        let mut other = end - before;
        (shortest, before) = (shortest.min(other), *end);
        // Euclid's algorithm, with rounding taken as zero.
        while other > 1e-9 * last {
            (unit, other) = (other, unit % other);
            if unit - other < 1e-9 * last {
                other = 0.0;
            }
        }
    }
    // An interval that is rounded to zero is no multiple.
    (unit > shortest / 64.0 && unit < 1.5 * shortest && last < MAX_UNITS * unit).then_some(unit)
}
