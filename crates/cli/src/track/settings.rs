//! Settings of the level and its sensors, from options and first rows.

use super::centre::World;
use super::meaning::{Meaning, Seat};
use super::rows::{Instant, Instants};
use super::sensors;
use crate::arguments::{Model, Switch, TrackOptions};
use crate::bounds::PerColumn;
use crate::error::Error;
use crate::numbers::{above_zero, mean_and_deviation, number};
use crate::report::Report;
use fewbits_filters::calibration::{self, Number, median, offsets, wrapped};

/// Number of rows that are examined before the first estimate.
const FIRST_ROWS: usize = 200;
/// The same of a table of single reports: for each sensor, and at most.
const FIRST_REPORTS: usize = 200;
const MOST_FIRST: usize = 2000;
/// Ratio of the standard deviation of a normal variable to the median of its distance from its mean.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Smallest and largest assumed share of lost reports.
const LOSS: (f64, f64) = (0.02, 0.5);
/// Standard deviation of rounding to a step, in steps.
const ROUNDING: f64 = 0.29;
/// Measurements and process in the first guess: the change is this share of the noise.
const FIRST_CHANGE: f64 = 0.3;
/// Median of the absolute value of a standard normal variable.
const NORMAL_MEDIAN: f64 = 0.6745;

const DO_NOT_VARY: &str = "the first rows do not vary, so it cannot be found from them";
const NO_VALUES: &str = "it cannot be found from reports of few bits";

/// All settings of a centre for a level.
pub(super) struct Settings {
    pub(super) world: World,
    noises: PerColumn<Option<f64>>,
    /// Noise that was found for each sensor of the first rows.
    found: Vec<f64>,
    /// Noise of all other sensors for which none is stated.
    pub(super) noise: f64,
    sends: PerColumn<Report>,
    thresholds: PerColumn<Option<f64>>,
    /// Per sensor, as far as the first rows go.
    losses: Vec<f64>,
    offsets: Vec<f64>,
    meaning: Meaning,
    /// Step of rounding, if it is found from the first rows: of each sensor.
    steps: Vec<Option<f64>>,
}

/// A sensor is taken to round if its noise with rounding is at most this many steps; its own noise is then at least this many.
const COARSE: f64 = 0.75;
const LEAST_OWN: f64 = 0.05;
/// Values from which a step of rounding is found, at least.
const FEWEST_OF_STEP: usize = 50;

/// Parses `0.25..`, `..40` or `0.25..40`.
fn limits(text: &str) -> Result<(Option<f64>, Option<f64>), Error> {
    const EXPECTED: &str = "a lower limit, an upper one, or both, as `0.25..`, `..40` or `0.25..40`";
    let (low, high) = text
        .split_once("..")
        .ok_or_else(|| Error::option("--limits", text, EXPECTED))?;
    let end = |end: &str| {
        (!end.trim().is_empty())
            .then(|| number("--limits", end, EXPECTED))
            .transpose()
    };
    Ok((end(low)?, end(high)?))
}

/// Parses `0.5/1h`. Numbered rows are one second apart.
fn change(text: &str) -> Result<(f64, f64), Error> {
    const EXPECTED: &str = "a change above 0 and the time in which it happens, as `0.5/1h`, or `0.5` in one row";
    let Some((size, time)) = text.split_once('/') else {
        return Ok((above_zero("--change", text, EXPECTED)?, 1.0));
    };
    let time = humantime::parse_duration(time).map_err(|_| Error::option("--change", text, EXPECTED))?;
    let seconds = time.as_secs_f64();
    if seconds > 0.0 {
        Ok((above_zero("--change", size, EXPECTED)?, seconds))
    } else {
        Err(Error::option("--change", text, EXPECTED))
    }
}

/// Finite measurements of one sensor.
fn values_of(first: &[Instant], sensor: usize) -> Vec<f64> {
    let all = first.iter().flat_map(|instant| &instant.reports);
    let own = all.filter(|(other, _)| *other == sensor);
    own.filter_map(|(_, cell)| cell.filter(|cell| cell.is_finite()))
        .collect()
}

/// The first rows as instants of finite values.
fn values(first: &[Instant], offsets: &[f64]) -> Vec<calibration::Instant> {
    let offset = |sensor: usize| offsets.get(sensor).copied().unwrap_or(0.0);
    let of = |instant: &Instant| calibration::Instant {
        seconds: instant.seconds,
        values: instant
            .reports
            .iter()
            .filter_map(|(sensor, cell)| Some((*sensor, cell.filter(|cell| cell.is_finite())? - offset(*sensor))))
            .collect(),
    };
    first.iter().map(of).collect()
}

impl Settings {
    pub(super) fn find(options: &TrackOptions, instants: &mut Instants) -> Result<Self, Error> {
        const NOISE: &str = "a standard deviation above 0";
        const THRESHOLD: &str = "a number";
        let noises = PerColumn::parse(&options.noise, None, |text| above_zero("--noise", text, NOISE).map(Some))?;
        let thresholds =
            PerColumn::parse(&options.threshold, None, |text| number("--threshold", text, THRESHOLD).map(Some))?;
        let sends = PerColumn::parse(&options.send, Report::Value, sensors::parse)?;
        if options.table.by.is_none() {
            noises.check(&instants.names, instants.file())?;
            thresholds.check(&instants.names, instants.file())?;
            sends.check(&instants.names, instants.file())?;
        }
        let asked_change = options.change.as_deref().map(change).transpose()?;
        let asked_prior = options
            .prior
            .as_deref()
            .map(|text| mean_and_deviation("--prior", text))
            .transpose()?;
        let asked_noise = noises.of("*").filter(|_| !options.noise.is_empty());
        // If no first rows are needed, do not wait for them: estimates then follow a pipe without delay.
        let known = asked_change.is_some() && asked_prior.is_some() && asked_noise.is_some() && options.align.is_none();
        let mut rows = if known {
            1
        } else {
            FIRST_ROWS.max(options.align.unwrap_or(0))
        };
        if options.table.by.is_some() && !known {
            // Rows are single reports.
            instants.peek(rows)?;
            rows = (FIRST_REPORTS * instants.names.len()).clamp(rows, MOST_FIRST.max(rows));
        }
        let first: Vec<Instant> = instants.peek(rows)?.iter().cloned().collect();
        if first.is_empty() {
            return Err(Error::empty(instants.file(), "rows"));
        }
        let sensors = instants.names.len();
        if let Some(period) = options.period
            && !(period > 0.0 && period.is_finite())
        {
            return Err(Error::option("--period", &period.to_string(), "a period above 0, as 360"));
        }
        let gaps = (0..sensors).map(|sensor| {
            let rows = first.iter().flat_map(|instant| &instant.reports);
            let (all, empty) = rows
                .filter(|(other, _)| *other == sensor)
                .fold((0.0, 0.0), |(all, empty), (_, cell)| (all + 1.0, empty + f64::from(u8::from(cell.is_none()))));
            (empty / f64::max(all, 1.0)).clamp(LOSS.0, LOSS.1)
        });
        let asked_step = options
            .rounded
            .as_deref()
            .filter(|text| !matches!(*text, "found" | "no"))
            .map(|text| above_zero("--rounded", text, "a step above 0, `found` or `no`"))
            .transpose()?;
        let within = options
            .silent_within
            .as_deref()
            .map(|text| above_zero("--silent-within", text, "a width above 0"))
            .transpose()?;
        let mut settings = Self {
            steps: Vec::new(),
            meaning: Meaning {
                step: asked_step,
                silent_within: within,
                limits: options.limits.as_deref().map_or(Ok((None, None)), limits)?,
                has_accuracy: options.accuracy_column.is_some(),
            },
            world: World {
                model: options.model,
                change: 0.0,
                within: 1.0,
                prior: (0.0, 0.0),
                slope: options
                    .slope
                    .as_deref()
                    .map(|text| mean_and_deviation("--slope", text))
                    .transpose()?,
                period: options.period,
                is_smoothed: options.smooth.is_some(),
                is_learning: options
                    .learning
                    .map_or(asked_change.is_none(), |learning| learning == Switch::On),
                interval: median(first.windows(2).map(|pair| pair[1].seconds - pair[0].seconds).collect()),
            },
            noises,
            found: Vec::new(),
            noise: 0.0,
            sends,
            thresholds,
            losses: gaps.collect(),
            offsets: options.align.map_or(Vec::new(), |rows| {
                offsets(&values(&first[..rows.min(first.len())], &[]), sensors, options.period)
            }),
        };
        if settings.world.interval <= 0.0 {
            settings.world.interval = 1.0;
        }
        settings.world.within = asked_change.map_or(settings.world.interval, |change| change.1);
        let can_look = |option: &'static str, asked: bool| {
            let is_bits =
                options.reports && (0..sensors).any(|n| settings.sends.of(&instants.names[n]) != &Report::Value);
            if is_bits && !asked {
                Err(Error::Needed {
                    option,
                    reason: NO_VALUES,
                })
            } else {
                Ok(())
            }
        };
        can_look("--noise", asked_noise.is_some())?;
        can_look("--change", asked_change.is_some())?;
        can_look("--prior", asked_prior.is_some())?;
        settings.world.change = asked_change.map_or(0.0, |change| change.0);
        settings.noise = asked_noise.unwrap_or(0.0);
        settings.world.prior = asked_prior.unwrap_or((0.0, 0.0));
        if asked_change.is_none() || asked_noise.is_none() || asked_prior.is_none() {
            settings.fit(&first, &instants.names)?;
        }
        if asked_step.is_none() && options.rounded.as_deref() != Some("no") {
            settings.find_steps(&first, &instants.names);
        }
        Ok(settings)
    }

    /// Estimates what no option states from the first rows: the prior from their spread, change and noise by maximum likelihood of the
    /// unquantized values.
    fn fit(&mut self, first: &[Instant], names: &[String]) -> Result<(), Error> {
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
                option: "--prior",
                reason: "the first rows hold no numbers",
            });
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
        let steps = fewbits_adaptive::own_steps(&flat);
        let floor = ROUNDING * steps.into_iter().reduce(f64::min).unwrap_or(0.0);
        // The median is 0 if most values repeat the one before.
        let scale = [typical, mean_size, spread].into_iter().find(|size| *size > 0.0);
        let Some(scale) = scale.map(|scale| scale.max(floor)) else {
            return Err(Error::Needed {
                option: if self.noise > 0.0 { "--change" } else { "--noise" },
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
                        .map(|(_, value)| *value)
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
        if !(fit_change || fit_noise) {
            return Ok(());
        }
        let noise = |name: &String| match self.noises.of(name) {
            // The fit takes values for what they are with rounding.
            Some(stated) => Number::Known(stated.hypot(floor)),
            None if fit_noise => Number::Unknown {
                guess: self.noise,
                least: floor,
            },
            None => Number::Known(self.noise.hypot(floor)),
        };
        let noises: Vec<Number> = names.iter().map(noise).collect();
        let change = match fit_change {
            true => Number::Unknown {
                guess: self.world.change,
                least: 0.0,
            },
            false => Number::Known(self.world.change),
        };
        let instants = values(first, &self.offsets);
        let found = self
            .world
            .calibrate(&instants, change, self.world.change, &noises)
            .map_err(|source| Error::Refused {
                what: "change and noise cannot be found",
                source: source.into(),
            })?;
        self.world.change = found.change;
        if fit_noise {
            self.noise = median(found.noises.clone());
            self.found = found.noises;
        }
        Ok(())
    }

    /// Finds which sensors round so coarsely that a value is a cell.
    fn find_steps(&mut self, first: &[Instant], names: &[String]) {
        let step_of = |sensor: usize| {
            let values = values_of(first, sensor);
            let step = fewbits_adaptive::own_steps(&values).into_iter().reduce(f64::min)?;
            let noise = self
                .noises
                .of(&names[sensor])
                .unwrap_or_else(|| self.found.get(sensor).copied().unwrap_or(self.noise));
            (values.len() >= FEWEST_OF_STEP && noise <= COARSE * step).then_some(step)
        };
        let steps: Vec<Option<f64>> = (0..names.len()).map(step_of).collect();
        for (sensor, step) in steps.iter().enumerate() {
            // What was found includes the rounding; what was stated does not.
            if let (Some(step), Some(found)) = (step, self.found.get_mut(sensor)) {
                let own = (*found * *found - ROUNDING * ROUNDING * step * step).max(0.0).sqrt();
                *found = own.max(LEAST_OWN * step);
            }
        }
        self.steps = steps;
    }

    fn seat_with(&self, sensor: usize, sends: Report, noise: f64, threshold: Option<f64>) -> Seat {
        Seat {
            sends,
            noise,
            threshold,
            loss: self.losses.get(sensor).copied().unwrap_or(LOSS.0),
            offset: self.offsets.get(sensor).copied().unwrap_or(0.0),
            meaning: Meaning {
                step: self.meaning.step.or(self.steps.get(sensor).copied().flatten()),
                ..self.meaning
            },
        }
    }

    /// The model of a sensor.
    pub(super) fn seat(&self, sensor: usize, name: &str) -> Seat {
        let found = || self.found.get(sensor).copied().unwrap_or(self.noise);
        let noise = self.noises.of(name).unwrap_or_else(found);
        self.seat_with(sensor, *self.sends.of(name), noise, *self.thresholds.of(name))
    }

    /// Whether any sensor sends quantized reports.
    pub(super) fn has_bits(&self, names: &[String]) -> bool {
        names.iter().any(|name| *self.sends.of(name) != Report::Value)
    }
}
