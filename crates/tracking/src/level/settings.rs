//! Settings of the level and its sensors, from options and first rows.

use crate::error::Error;
use crate::first::lasting::Lasting;
use crate::first::limits;
use crate::first::values::{held_values, values, values_in, values_of, vary};
use crate::level::hints::{Seen, circle, hints};
use crate::level::later::Later;
use crate::level::meaning::{Meaning, Seat};
use crate::level::options::{Known, LevelOptions, Model, PerSensor};
use crate::level::report::Report;
use crate::level::world::World;
use crate::rows::instant::Instant;
use crate::rows::{Instants, Rows};
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

/// An angle: its period, and the end of the period within which it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Circle {
    pub(crate) period: f64,
    pub(crate) low: f64,
}

/// All settings of a centre for a level.
#[derive(Clone)]
pub(crate) struct Settings {
    pub(crate) world: World,
    pub(crate) noises: PerSensor<Option<f64>>,
    /// Noise that was found for each sensor of the first rows.
    pub(crate) found: Vec<f64>,
    /// Noise of all other sensors for which none is stated.
    pub(crate) noise: f64,
    pub(crate) sends: PerSensor<Report>,
    pub(crate) thresholds: PerSensor<Option<f64>>,
    /// Per sensor, as far as the first rows go.
    losses: Vec<f64>,
    pub(crate) offsets: Vec<f64>,
    pub(crate) meaning: Meaning,
    /// Detection limits that are found from the first rows: of each sensor.
    pub(crate) limits: Vec<limits::Ends>,
    /// Step of rounding, if it is found from the first rows: of each sensor.
    pub(crate) steps: Vec<Option<f64>>,
    /// Whether a model with a slope explains the first rows far better.
    pub(crate) has_slope: bool,
    /// Whether that model is then taken.
    pub(crate) may_slope: bool,
    /// If the level is an angle, where it is written: about zero if the first rows have negative values.
    pub(crate) circle: Option<Circle>,
    /// What the first rows suggest that no option says.
    pub(crate) hints: Vec<String>,
    /// What is found again while rows come.
    pub(crate) later: Option<Later>,
    /// Errors that last from row to row.
    pub(crate) lasting: Option<Lasting>,
    /// Each row is a report by itself.
    pub(crate) is_single: bool,
}

impl Settings {
    pub(crate) fn find<R: Rows>(options: &LevelOptions, instants: &mut Instants<R>) -> Result<Self, Error> {
        options.check()?;
        let (asked_change, asked_prior, asked_noise) = (options.change, options.prior, options.noise.others);
        let is_single = instants.options().single_reports;
        let has_transform = instants.options().transform.is_some();
        // If no first rows are needed, do not wait for them: estimates then follow a pipe without delay.
        let known = asked_change.is_some() && asked_prior.is_some() && asked_noise.is_some() && options.align.is_none();
        let mut rows = if known {
            1
        } else {
            FIRST_ROWS.max(options.align.unwrap_or(0))
        };
        if is_single && !known {
            // Rows are single reports.
            instants.peek(rows)?;
            rows = (FIRST_REPORTS * instants.names().len()).clamp(rows, MOST_FIRST.max(rows));
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
        let may_repeat = !known && !options.reports && options.silent_within.is_none();
        if may_repeat {
            instants.leave_out_again();
        }
        let held = if may_repeat && !is_single {
            instants.leave_out_repetitions()
        } else {
            Vec::new()
        };
        let first: Vec<Instant> = instants.peek(rows)?.iter().take(rows).cloned().collect();
        if first.is_empty() {
            return Err(Error::Empty);
        }
        // From a file that is there as a whole, more rows can be read.
        let more: Vec<Instant> = if instants.source().is_live() {
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
        let sensors = instants.names().len();
        let has_negative = (0..sensors).any(|sensor| values_of(looked_at, sensor).iter().any(|value| *value < 0.0));
        let mut told = instants.source().found().to_vec();
        told.extend(
            instants
                .options()
                .transform
                .and_then(|transform| transform.doubt(&first)),
        );
        let names = instants.names().to_vec();
        told.extend(held.iter().map(|sensor| {
            format!(
                "{} repeats its values in the rows that follow them: repetitions are left out, since they are no measurements; --noise, \
                 --change and --prior together keep them",
                names[*sensor]
            )
        }));
        let period = match options.period {
            Known::No => None,
            Known::Is(period) => Some(period),
            Known::Found if options.reports || has_transform => None,
            Known::Found => (0..sensors).find_map(|sensor| {
                let period = circle(&values_of(looked_at, sensor))?;
                let name = &names[sensor];
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
        let asked_step = match options.rounded {
            Known::Is(step) => Some(step),
            _ => None,
        };
        let within = options.silent_within;
        let aligned = |rows: &[Instant]| match within {
            Some(_) => held_values(rows),
            None => values(rows, &[]),
        };
        let found_limits = if options.limits != Known::Found || options.reports || options.has_limits || has_transform {
            Vec::new()
        } else {
            (0..sensors)
                .map(|sensor| limits::found(&values_of(looked_at, sensor), &names[sensor], &mut told))
                .collect()
        };
        let mut settings = Self {
            limits: found_limits,
            steps: Vec::new(),
            has_slope: false,
            hints: told,
            later: None,
            lasting: None,
            is_single,
            may_slope: options.model.is_none(),
            circle: period.map(|period| Circle {
                period,
                low: if has_negative { -0.5 * period } else { 0.0 },
            }),
            meaning: Meaning {
                step: asked_step,
                silent_within: within,
                limits: match options.limits {
                    Known::Is(ends) => ends,
                    _ => (None, None),
                },
                has_accuracy: options.has_accuracies,
                has_limits: options.has_limits,
            },
            world: World {
                model: options.model.unwrap_or(Model::Walk),
                change: 0.0,
                within: 1.0,
                prior: (0.0, 0.0),
                slope: options.slope,
                period,
                sensors,
                steepest: 0.0,
                is_smoothed: options.smooth,
                // Of single reports nothing tells the noise, and a wrong one misleads an exact filter more.
                is_on_grid: within.is_some() && (asked_noise.is_some() || !is_single),
                is_on_change: within.is_some(),
                is_followed: false,
                is_lasting: false,
                zero: 0.0,
                open: None,
                is_learning: options.learning.unwrap_or(asked_change.is_none()),
                interval: median(first.windows(2).map(|pair| pair[1].seconds - pair[0].seconds).collect()),
            },
            noises: options.noise.clone(),
            found: Vec::new(),
            noise: 0.0,
            sends: options.send.clone(),
            thresholds: options.threshold.clone(),
            losses: gaps.collect(),
            offsets: options
                .align
                .map_or(Vec::new(), |rows| offsets(&aligned(&first[..rows.min(first.len())]), sensors, period)),
        };
        if settings.world.interval <= 0.0 {
            settings.world.interval = 1.0;
        }
        settings.world.within = asked_change.map_or(settings.world.interval, |change| change.1);
        let can_look = |argument: &'static str, asked: bool| {
            let is_bits = options.reports && (0..sensors).any(|n| settings.sends.of(&names[n]) != &Report::Value);
            if is_bits && !asked {
                Err(Error::Needed {
                    argument,
                    reason: NO_VALUES,
                })
            } else {
                Ok(())
            }
        };
        if instants.has_samples() && asked_noise.is_none() {
            return Err(Error::Needed {
                argument: "noise",
                reason: "values that a sensor sends only on change do not tell it",
            });
        }
        can_look("noise", asked_noise.is_some())?;
        can_look("change", asked_change.is_some())?;
        can_look("prior", asked_prior.is_some())?;
        settings.world.change = asked_change.map_or(0.0, |change| change.0);
        settings.noise = asked_noise.unwrap_or(0.0);
        settings.world.prior = asked_prior.unwrap_or((0.0, 0.0));
        let is_unknown = asked_change.is_none() || asked_noise.is_none() || asked_prior.is_none();
        let unknown = is_unknown.then(|| settings.fit(&first, &names)).transpose()?;
        if asked_step.is_none() && options.rounded != Known::No {
            settings.find_steps(&first, &names);
        }
        let is_rounded = settings.steps.iter().any(Option::is_some);
        let is_cut = settings.is_cut(options, &names);
        // Rounded values are cells, of which change and noise are found anew.
        if let Some(unknown) = unknown.as_ref().filter(|unknown| unknown.change || unknown.noise)
            && is_rounded
        {
            settings.calibrate(&first, &names, unknown)?;
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
            let is_live = instants.source().is_live();
            let is_refined = !is_live && more.len() > first.len() && settings.refine((&first, more), &names, &unknown);
            settings.find_openness(if is_refined { more } else { &first }, &names, &unknown);
            if is_live {
                settings.later = Some(Later::new(unknown, first.len(), most));
                // Behind estimates that are written the model stays.
                settings.may_slope = false;
            }
        }
        if !options.reports && !instants.has_samples() {
            settings.find_differences(&more, &names, options);
        }
        // Cells have no residual that would tell whether the change is right.
        let has_cells = is_cut
            || settings.meaning.silent_within.is_some()
            || settings.meaning.step.is_some()
            || settings.steps.iter().any(Option::is_some);
        if options.learning.is_none() && has_cells {
            settings.world.is_learning = false;
        }
        let noises: Vec<f64> = names
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
        let is_stated = asked_noise.is_some() || options.noise.is_stated();
        if is_stated
            && !options.reports
            && !settings.world.is_on_grid
            && !instants.source().is_live()
            && !instants.has_samples()
        {
            settings.hints.extend(settings.doubts(&more, &names));
        }
        let may_doubt = settings.meaning.has_accuracy && !settings.world.is_on_grid && !instants.source().is_live();
        if may_doubt && !known {
            settings
                .hints
                .extend(settings.doubted_accuracies(&more, &names, options));
        }
        let seen = Seen {
            has_slope: settings.has_slope,
            is_single,
            has_samples: instants.has_samples(),
        };
        let found = hints(options, &first, &names, apart, seen);
        settings.hints.extend(found);
        if !options.noise.is_stated() && options.change.is_none() && !options.reports {
            settings.hints.extend(settings.repeating(&first, &names));
        }
        Ok(settings)
    }

    pub(crate) fn seat_with(&self, sensor: usize, sends: Report, noise: f64, threshold: Option<f64>) -> Seat {
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
    pub(crate) fn seat(&self, sensor: usize, name: &str) -> Seat {
        let found = || self.found.get(sensor).copied().unwrap_or(self.noise);
        let noise = self.noises.of(name).unwrap_or_else(found);
        self.seat_with(sensor, *self.sends.of(name), noise, *self.thresholds.of(name))
    }

    /// Whether any sensor sends quantized reports.
    pub(crate) fn has_bits(&self, names: &[String]) -> bool {
        names.iter().any(|name| *self.sends.of(name) != Report::Value)
    }
}
