//! What is found from the first rows: prior, change, noise of each sensor, steps of rounding.

use crate::error::Error;
use crate::first::lasting::lasting;
use crate::first::limits::Ends;
use crate::first::rounding;
use crate::first::values::{steepest, values, values_of};
use crate::level::later::Unknown;
use crate::level::meaning::Seat;
use crate::level::options::{LevelOptions, Model};
use crate::level::repeating::REPEATING;
use crate::level::report::Report;
use crate::level::settings::Settings;
use crate::level::world::World;
use crate::rows::instant::{Instant, Qualifier};
use fewbits_filters::calibration::{self, Calibration, Number, median, wrapped};
use fewbits_filters::fit::SensorTest;

/// Ratio of the standard deviation of a normal variable to the median of its distance from its mean.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Measurements and process in the first guess: the change is this share of the noise.
const FIRST_CHANGE: f64 = 0.3;
/// Median of the absolute value of a standard normal variable.
const NORMAL_MEDIAN: f64 = 0.6745;
const DO_NOT_VARY: &str = "the first rows do not vary, so it cannot be found from them";
/// The own noise of a sensor that rounds is at least this many steps.
const LEAST_OWN: f64 = 0.05;
/// A model with a slope is suggested if it explains the first rows better by so many nats.
const SLOPING: f64 = 20.0;

/// The first rows may be less likely by so many nats, and one more for each number, under what more rows say: as far as chance goes once in a
/// thousand tables.
const LOSS_ALONE: f64 = 5.0;

/// Share of values beyond a limit up to which the mean and the deviation of all say those of the level.
const MOST_CUT: f64 = 0.05;

/// A value that is rounded is a cell, and no number with more noise, if its step is more than so many deviations of the noise.
const WIDE_CELL: f64 = 2.0;

/// Least guess of the change, as a share of the noise.
const LEAST_GUESS: f64 = 0.01;

fn refused(source: fewbits_filters::Error) -> Error {
    Error::Refused {
        what: "change and noise cannot be found",
        source: source.into(),
    }
}

impl Settings {
    /// Estimates what no option states from the first rows: the prior from their spread, change and noise by maximum likelihood of the
    /// unquantized values.
    pub(crate) fn fit(&mut self, first: &[Instant], names: &[String]) -> Result<Unknown, Error> {
        let sensors = names.len();
        let shifted = |n: usize| {
            let offset = self.offsets.get(n).copied().unwrap_or(0.0);
            values_of(first, n)
                .into_iter()
                .map(|value| value - offset)
                .collect::<Vec<f64>>()
        };
        let all: Vec<Vec<f64>> = (0..sensors).map(shifted).collect();
        let flat: Vec<f64> = all.iter().flatten().copied().collect();
        if flat.is_empty() {
            return Err(Error::Needed {
                argument: "prior",
                reason: "the first rows hold no numbers",
            });
        }
        if self.world.model == Model::Returning && self.world.prior.1 == 0.0 {
            let readings = self.readings(first, names);
            let all = readings.iter().flat_map(|instant| &instant.values);
            let is_cut = |reading: &calibration::Reading| matches!(reading, calibration::Reading::Within { lower, upper } if (upper - lower).is_infinite());
            let (count, cut) = all.fold((0.0, 0.0), |(count, cut), (_, reading)| {
                (count + 1.0, cut + f64::from(u8::from(is_cut(reading))))
            });
            if cut > MOST_CUT * count {
                return Err(Error::Needed {
                    argument: "prior",
                    reason: "values beyond a limit do not tell the mean and the deviation of a level that returns",
                });
            }
        }
        // A wild value moves neither middle nor spread. If most values are equal, the spread is that of all.
        let period = self.world.period;
        let from = |middle: f64| flat.iter().map(move |value| wrapped(value - middle, period));
        let mean = flat[0] + median(from(flat[0]).collect());
        let robust = DEVIATION_OF_MEDIAN * median(from(mean).map(f64::abs).collect());
        let spread = if robust > 0.0 {
            robust
        } else {
            (from(mean).map(|off| off * off).sum::<f64>() / flat.len() as f64).sqrt()
        };
        let differences: Vec<f64> = all
            .iter()
            .flat_map(|values| values.windows(2).map(|pair| wrapped(pair[1] - pair[0], period).abs()))
            .collect();
        // At a constant level the difference of two values has `sqrt(2)` times the deviation of the noise. Jumps of the level hardly move the
        // median.
        let typical = median(differences.clone()) / (NORMAL_MEDIAN * std::f64::consts::SQRT_2);
        let mean_size = differences.iter().sum::<f64>() / (differences.len() as f64).max(1.0);
        let floor = rounding::DEVIATION * rounding::step(&flat).unwrap_or(0.0);
        // The median is 0 if most values repeat the one before.
        let scale = [typical, mean_size, spread].into_iter().find(|size| *size > 0.0);
        let Some(scale) = scale.map(|scale| scale.max(floor)) else {
            return Err(Error::Needed {
                argument: if self.noise > 0.0 { "change" } else { "noise" },
                reason: DO_NOT_VARY,
            });
        };
        let (fit_change, fit_noise) = (self.world.change == 0.0, self.noise == 0.0);
        if self.world.prior.1 == 0.0 {
            let deviation = if self.world.model == Model::Returning {
                spread.max(scale)
            } else {
                // The level of the first row is not the mean of all.
                2.0 * spread.max(scale)
            };
            self.world.prior = (
                if self.world.model == Model::Returning {
                    mean
                } else {
                    // Of the first few values one may be wild.
                    let first: Vec<f64> = values(first, &self.offsets)
                        .iter()
                        .flat_map(|instant| &instant.values)
                        .filter_map(|(_, reading)| reading.value())
                        .take(3)
                        .collect();
                    let origin = first.first().copied().unwrap_or(mean);
                    origin + median(first.iter().map(|value| wrapped(value - origin, period)).collect())
                },
                deviation,
            );
        }
        if fit_noise {
            self.noise = scale;
        }
        if fit_change {
            self.world.change = FIRST_CHANGE * scale;
        }
        self.world.steepest = steepest(&values(first, &self.offsets), sensors, period);
        let unknown = Unknown {
            change: fit_change,
            noise: fit_noise,
            floor,
        };
        if fit_change || fit_noise {
            self.calibrate(first, names, &unknown)?;
        }
        Ok(unknown)
    }

    /// The step to which a sensor rounds.
    pub(crate) fn step_of(&self, sensor: usize) -> Option<f64> {
        self.meaning.step.or(self.steps.get(sensor).copied().flatten())
    }

    /// The first rows with what their cells mean.
    pub(crate) fn readings(&self, first: &[Instant], names: &[String]) -> Vec<calibration::Instant> {
        let seats: Vec<Seat> = (0..names.len())
            .map(|sensor| self.seat_with(sensor, Report::Value, self.noise, None))
            .collect();
        let mut last = vec![None; names.len()];
        let mut reading = |sensor: usize, cell: Option<f64>, qualifier: Qualifier| {
            let seat = seats.get(sensor)?;
            let cell = cell.filter(|cell| cell.is_finite()).map(|cell| cell - seat.offset);
            let found = seat.reading(cell, qualifier, last[sensor])?;
            last[sensor] = cell.or(last[sensor]);
            Some((
                sensor,
                if found.lower == found.upper {
                    calibration::Reading::Value {
                        value: found.lower,
                        deviation: qualifier.accuracy.filter(|accuracy| *accuracy > 0.0),
                    }
                } else {
                    calibration::Reading::Within {
                        lower: found.lower,
                        upper: found.upper,
                    }
                },
            ))
        };
        first
            .iter()
            .map(|instant| calibration::Instant {
                seconds: instant.seconds,
                values: instant
                    .reports
                    .iter()
                    .enumerate()
                    .filter_map(|(i, (sensor, cell))| {
                        reading(*sensor, *cell, instant.qualifiers.get(i).copied().unwrap_or_default())
                    })
                    .collect(),
            })
            .collect()
    }

    /// Change and noises as far as they are to be found; the others, and all without `unknown`, are known.
    pub(crate) fn numbers(&self, names: &[String], unknown: Option<&Unknown>) -> (Number, Vec<Number>) {
        let floor = unknown.map_or(0.0, |unknown| unknown.floor);
        let noise = |(sensor, name): (usize, &String)| {
            let step = self.step_of(sensor);
            // Where rounding is not a cell, it is part of the noise.
            let with = |own: f64| if step.is_some() { own } else { own.hypot(floor) };
            match self.noises.of(name) {
                Some(stated) => Number::Known(with(*stated)),
                None if unknown.is_some_and(|unknown| unknown.noise) => Number::Unknown {
                    guess: self.found.get(sensor).copied().unwrap_or(self.noise),
                    least: step.map_or(floor, |step| LEAST_OWN * step),
                },
                // What was found has its share of rounding.
                None => Number::Known(self.found.get(sensor).copied().unwrap_or(with(self.noise))),
            }
        };
        let change = match unknown.is_some_and(|unknown| unknown.change) {
            true => Number::Unknown {
                guess: self.world.change,
                least: 0.0,
            },
            false => Number::Known(self.world.change),
        };
        (change, names.iter().enumerate().map(noise).collect())
    }

    /// Finds change and noises as far as no option states them.
    pub(crate) fn calibrate(&mut self, first: &[Instant], names: &[String], unknown: &Unknown) -> Result<(), Error> {
        let (change, noises) = self.numbers(names, Some(unknown));
        let readings = self.readings(first, names);
        let mut found = self
            .world
            .calibrate(&readings, change, self.world.change, &noises)
            .map_err(refused)?;
        self.compare_slope(&mut found, &readings, (change, &noises), unknown);
        self.take(found, unknown);
        Ok(())
    }

    /// Takes a model with a slope if it explains the readings far better than the walk under which `found` was found.
    fn compare_slope(
        &mut self,
        found: &mut Calibration,
        readings: &[calibration::Instant],
        (change, noises): (Number, &[Number]),
        unknown: &Unknown,
    ) {
        // Silence cuts the belief: that of a walk is followed exactly, and that of a slope is not.
        if !unknown.change || self.world.model != Model::Walk || self.world.is_on_grid {
            return;
        }
        // The same with a slope, which is only compared.
        let sloping = World {
            model: Model::Velocity,
            ..self.world
        };
        let other = sloping.calibrate(readings, change, self.world.change, noises);
        if let Some(other) = other
            .ok()
            .filter(|other| other.log_likelihood > found.log_likelihood + SLOPING)
        {
            self.has_slope = true;
            if self.may_slope {
                (self.world.model, *found) = (Model::Velocity, other);
            }
        }
    }

    fn take(&mut self, found: Calibration, unknown: &Unknown) {
        self.world.change = found.change;
        if unknown.noise {
            self.noise = median(found.noises.clone());
            self.found = found.noises;
        }
    }

    /// Finds change and noises again from `more` rows, the first ones among them. What is found is taken if it explains the first rows nearly as
    /// well as what was found from them alone: a sensor that fails later must not change the noise that it has before. Whether it is taken.
    pub(crate) fn refine(
        &mut self,
        (first, more): (&[Instant], &[Instant]),
        names: &[String],
        unknown: &Unknown,
    ) -> bool {
        let readings = self.readings(first, names);
        let explained = |settings: &Self| {
            let (change, noises) = settings.numbers(names, None);
            let found = settings
                .world
                .calibrate(&readings, change, settings.world.change, &noises);
            found.map_or(f64::NEG_INFINITY, |found| found.log_likelihood)
        };
        let before = (self.world, self.noise, self.found.clone(), self.has_slope);
        let likelihood = explained(self);
        if unknown.change {
            // First rows without a change are no guess of that of the others.
            self.world.change = self.world.change.max(LEAST_GUESS * self.noise);
        }
        let (change, noises) = self.numbers(names, Some(unknown));
        let readings_of_more = self.readings(more, names);
        let found = self
            .world
            .calibrate(&readings_of_more, change, self.world.change, &noises);
        let is_found = found.is_ok();
        if let Ok(mut found) = found {
            self.take(found.clone(), unknown);
            // A slope may show in more rows only: then differences from the forecasts of a walk keep a direction.
            let lasts = |test: &SensorTest| test.repetition > REPEATING || test.is_persistent();
            let is_sloping = self.may_slope && self.tests(&readings_of_more, names).iter().any(lasts);
            // A sensor that is slow makes a walk smooth.
            if is_sloping && lasting(more, names.len()).is_none() {
                self.compare_slope(&mut found, &readings_of_more, (change, &noises), unknown);
                self.take(found, unknown);
            }
        }
        let numbers = noises.iter().chain([&change]);
        let free = numbers.filter(|one| matches!(one, Number::Unknown { .. })).count();
        let is_taken = is_found && explained(self) >= likelihood - (LOSS_ALONE + free as f64);
        if !is_taken {
            (self.world, self.noise, self.found, self.has_slope) = before;
        }
        is_taken
    }

    /// Whether readings say only on which side of an end a measurement is, or within a cell that is wide beside the noise.
    pub(crate) fn is_cut(&self, options: &LevelOptions, names: &[String]) -> bool {
        let has_thresholds = options.has_thresholds
            || names
                .iter()
                .any(|name| self.thresholds.of(name).is_some() && *self.sends.of(name) == Report::Sign);
        let is_wide = |(sensor, name): (usize, &String)| {
            let step = self.step_of(sensor).unwrap_or(0.0);
            step > WIDE_CELL * self.seat(sensor, name).noise
        };
        let has_ends = |ends: &Ends| ends.0.is_some() || ends.1.is_some();
        has_thresholds
            || self.meaning.has_limits
            || std::iter::once(&self.meaning.limits).chain(&self.limits).any(has_ends)
            || names.iter().enumerate().any(is_wide)
    }

    /// Finds which sensors round so coarsely that a value is a cell.
    pub(crate) fn find_steps(&mut self, first: &[Instant], names: &[String]) {
        let step_of = |sensor: usize| {
            let noise = self
                .noises
                .of(&names[sensor])
                .unwrap_or_else(|| self.found.get(sensor).copied().unwrap_or(self.noise));
            rounding::coarse_step(&values_of(first, sensor), noise)
        };
        let steps: Vec<Option<f64>> = (0..names.len()).map(step_of).collect();
        for (sensor, step) in steps.iter().enumerate() {
            // What was found includes the rounding; what was stated does not.
            if let (Some(step), Some(found)) = (step, self.found.get_mut(sensor)) {
                let own = (*found * *found - rounding::DEVIATION * rounding::DEVIATION * step * step)
                    .max(0.0)
                    .sqrt();
                *found = own.max(LEAST_OWN * step);
            }
        }
        self.steps = steps;
    }
}
