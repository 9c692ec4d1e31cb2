//! Settings of the level and its sensors, from options and first rows.

use super::first::{held_values, values, values_in, values_of, vary};
use super::hints::{circle, hints};
use super::instant::Instant;
use super::lasting::Lasting;
use super::later::Later;
use super::limits::{self, limits};
use super::meaning::{Meaning, Seat, silence};
use super::report::Circle;
use super::rows::Instants;
use super::sensors;
use super::world::World;
use crate::arguments::{Model, Switch, TrackOptions};
use crate::bounds::PerColumn;
use crate::error::Error;
use crate::numbers::{above_zero, mean_and_deviation, number};
use crate::report::Report;
use fewbits_filters::calibration::{median, offsets, shift_deviation};
use std::collections::VecDeque;

/// Number of rows that are examined before the first estimate.
const FIRST_ROWS: usize = 200;
/// The same of a table of single reports: for each sensor, and at most.
const FIRST_REPORTS: usize = 200;
const MOST_FIRST: usize = 2000;
/// The same if the likelihood is found on a grid.
const MOST_ON_GRID: usize = 800;
/// At most if measurements without a row are among them.
const MOST_SAMPLES: usize = 20_000;
/// Values of a sensor from which no further rows are read before the first estimate.
const FEWEST_VALUES: usize = 30;
/// Smallest and largest assumed share of lost reports.
const LOSS: (f64, f64) = (0.02, 0.5);

const NO_VALUES: &str = "it cannot be found from reports of few bits";

/// All settings of a centre for a level.
pub(super) struct Settings {
    pub(super) world: World,
    pub(super) noises: PerColumn<Option<f64>>,
    /// Noise that was found for each sensor of the first rows.
    pub(super) found: Vec<f64>,
    /// Noise of all other sensors for which none is stated.
    pub(super) noise: f64,
    pub(super) sends: PerColumn<Report>,
    pub(super) thresholds: PerColumn<Option<f64>>,
    /// Per sensor, as far as the first rows go.
    losses: Vec<f64>,
    pub(super) offsets: Vec<f64>,
    pub(super) meaning: Meaning,
    /// Detection limits that are found from the first rows: of each sensor.
    pub(super) limits: Vec<limits::Ends>,
    /// Step of rounding, if it is found from the first rows: of each sensor.
    pub(super) steps: Vec<Option<f64>>,
    /// Whether a model with a slope explains the first rows far better.
    pub(super) has_slope: bool,
    /// Whether that model is then taken.
    pub(super) may_slope: bool,
    /// If the level is an angle, where it is written: about zero if the first rows have negative values.
    pub(super) circle: Option<Circle>,
    /// What the first rows suggest that no option says.
    pub(super) hints: Vec<String>,
    /// What is found again while rows come.
    pub(super) later: Option<Later>,
    /// Errors that last from row to row.
    pub(super) lasting: Option<Lasting>,
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
        if !known {
            // Where most cells are empty or equal, so few rows have too few values.
            let most = if instants.has_samples() {
                MOST_SAMPLES
            } else {
                MOST_FIRST
            };
            let is_enough = |first: &VecDeque<Instant>| values_in(first) >= FEWEST_VALUES && vary(first);
            while rows < most && instants.peek(rows)?.len() == rows && !is_enough(instants.peek(rows)?) {
                rows = (2 * rows).min(most);
            }
        }
        let may_hold = !known && !options.reports && options.silent_within.is_none() && options.table.by.is_none();
        let held = if may_hold {
            instants.leave_out_repetitions()
        } else {
            Vec::new()
        };
        let first: Vec<Instant> = instants.peek(rows)?.iter().cloned().collect();
        if first.is_empty() {
            return Err(Error::empty(instants.file(), "rows"));
        }
        // From a file that is there as a whole, more rows can be read.
        let more: Vec<Instant> = if instants.is_live() {
            first.clone()
        } else {
            instants
                .peek(MOST_FIRST)?
                .iter()
                .take(MOST_FIRST.max(first.len()))
                .cloned()
                .collect()
        };
        let looked_at = if known { &first } else { &more };
        let sensors = instants.names.len();
        let has_negative = (0..sensors).any(|sensor| values_of(looked_at, sensor).iter().any(|value| *value < 0.0));
        let mut told = instants.roles.told.clone();
        told.extend(held.iter().map(|sensor| {
            format!(
                "{} repeats its values in the rows that follow them: repetitions are left out, since they are no measurements; --noise, \
                 --change and --prior together keep them",
                instants.names[*sensor]
            )
        }));
        let period = match options.period.as_deref() {
            Some("no") => None,
            Some(text) => Some(above_zero("--period", text, "a period above 0, as 360, or `no`")?),
            None if options.reports || options.transform.is_some() => None,
            None => (0..sensors).find_map(|sensor| {
                let period = circle(&values_of(looked_at, sensor))?;
                let name = &instants.names[sensor];
                told.push(format!(
                    "{name} goes around a circle of {period}: it is taken for an angle, as --period {period} says; --period no takes it for a number"
                ));
                Some(period)
            }),
        };
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
            .map(silence)
            .transpose()?
            .map(|(width, _)| width);
        let aligned = |rows: &[Instant]| match within {
            Some(_) => held_values(rows),
            None => values(rows, &[]),
        };
        let found_limits =
            if options.limits.is_some() || options.reports || instants.has_limits || options.transform.is_some() {
                Vec::new()
            } else {
                (0..sensors)
                    .map(|sensor| limits::found(&values_of(looked_at, sensor), &instants.names[sensor], &mut told))
                    .collect()
            };
        let mut settings = Self {
            limits: found_limits,
            steps: Vec::new(),
            has_slope: false,
            hints: told,
            later: None,
            lasting: None,
            may_slope: options.model.is_none(),
            circle: period.map(|period| Circle {
                period,
                low: if has_negative { -0.5 * period } else { 0.0 },
            }),
            meaning: Meaning {
                step: asked_step,
                silent_within: within,
                limits: options.limits.as_deref().map_or(Ok((None, None)), limits)?,
                has_accuracy: options.accuracy_column.is_some(),
                has_limits: instants.has_limits,
            },
            world: World {
                model: options.model.unwrap_or(Model::Walk),
                change: 0.0,
                within: 1.0,
                prior: (0.0, 0.0),
                slope: options
                    .slope
                    .as_deref()
                    .map(|text| mean_and_deviation("--slope", text))
                    .transpose()?,
                period,
                sensors,
                steepest: 0.0,
                is_smoothed: options.smooth.is_some(),
                // Of single reports nothing tells the noise, and a wrong one misleads an exact filter more.
                is_on_grid: within.is_some() && (asked_noise.is_some() || options.table.by.is_none()),
                is_on_change: within.is_some(),
                is_followed: false,
                is_lasting: false,
                zero: 0.0,
                open: None,
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
            offsets: options
                .align
                .map_or(Vec::new(), |rows| offsets(&aligned(&first[..rows.min(first.len())]), sensors, period)),
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
        if instants.has_samples() && asked_noise.is_none() {
            return Err(Error::Needed {
                option: "--noise",
                reason: "values that a sensor sends only on change do not tell it",
            });
        }
        can_look("--noise", asked_noise.is_some())?;
        can_look("--change", asked_change.is_some())?;
        can_look("--prior", asked_prior.is_some())?;
        settings.world.change = asked_change.map_or(0.0, |change| change.0);
        settings.noise = asked_noise.unwrap_or(0.0);
        settings.world.prior = asked_prior.unwrap_or((0.0, 0.0));
        let is_unknown = asked_change.is_none() || asked_noise.is_none() || asked_prior.is_none();
        let unknown = is_unknown.then(|| settings.fit(&first, &instants.names)).transpose()?;
        if asked_step.is_none() && options.rounded.as_deref() != Some("no") {
            settings.find_steps(&first, &instants.names);
        }
        let is_rounded = settings.steps.iter().any(Option::is_some);
        let is_cut = settings.is_cut(options, &instants.names);
        // Rounded values are cells, of which change and noise are found anew.
        if let Some(unknown) = unknown.as_ref().filter(|unknown| unknown.change || unknown.noise)
            && is_rounded
        {
            settings.calibrate(&first, &instants.names, unknown)?;
        }
        settings.world.is_on_grid |= is_cut;
        if let Some(unknown) = unknown.filter(|unknown| unknown.change || unknown.noise) {
            // The likelihood on a grid takes long.
            let most = if settings.world.is_on_change {
                MOST_ON_GRID
            } else {
                MOST_FIRST
            };
            let more = &more[..more.len().min(most)];
            let (is_live, names) = (instants.is_live(), &instants.names);
            let is_refined = !is_live && more.len() > first.len() && settings.refine((&first, more), names, &unknown);
            settings.find_openness(if is_refined { more } else { &first }, names, &unknown);
            if is_live {
                settings.later = Some(Later::new(unknown, first.len(), most));
            }
        }
        if !options.reports && !instants.has_samples() {
            settings.find_differences(&more, &instants.names, options);
        }
        // Cells have no residual that would tell whether the change is right.
        let has_cells = is_cut
            || settings.meaning.silent_within.is_some()
            || settings.meaning.step.is_some()
            || settings.steps.iter().any(Option::is_some);
        if options.learning.is_none() && has_cells {
            settings.world.is_learning = false;
        }
        let noises: Vec<f64> = instants
            .names
            .iter()
            .enumerate()
            .map(|(sensor, name)| settings.seat(sensor, name).noise)
            .collect();
        let apart = (noises.as_slice(), settings.offsets.as_slice());
        if let Some(rows) = options.align {
            // Of the level each sensor tells a share.
            let weights: Vec<f64> = noises.iter().map(|noise| 1.0 / (noise * noise)).collect();
            let first = aligned(&first[..rows.min(first.len())]);
            settings.world.zero = shift_deviation(&first, &weights, period);
        }
        let is_stated = asked_noise.is_some() || !options.noise.is_empty();
        if is_stated && !options.reports && !settings.world.is_on_grid && !instants.is_live() && !instants.has_samples()
        {
            settings.hints.extend(settings.doubts(&more, &instants.names));
        }
        let found = hints(options, &first, &instants.names, apart, settings.has_slope);
        settings.hints.extend(found);
        if options.noise.is_empty() && options.change.is_none() && !options.reports {
            settings.hints.extend(settings.repeating(&first, &instants.names));
        }
        Ok(settings)
    }

    pub(super) fn seat_with(&self, sensor: usize, sends: Report, noise: f64, threshold: Option<f64>) -> Seat {
        Seat {
            sends,
            noise,
            threshold,
            loss: self.losses.get(sensor).copied().unwrap_or(LOSS.0),
            offset: self.offsets.get(sensor).copied().unwrap_or(0.0),
            meaning: Meaning {
                step: self.step_of(sensor),
                limits: self.limits.get(sensor).copied().unwrap_or(self.meaning.limits),
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
