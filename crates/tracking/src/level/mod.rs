//! A level that sensors measure: estimates with bands, row by row.
//!
//! | file | what it holds |
//! |---|---|
//! | `options`, `report` | what is known of level and sensors, what sensors send |
//! | `settings` | what options and first rows say |
//! | `found`, `later`, `open` | what is found from first rows, again while rows come, and what they leave open |
//! | `hints`, `doubts`, `repeating` | what the first rows suggest that no option says, what values say against the stated noise |
//! | `world`, `meaning`, `stated` | the model of the level, what cells mean, readings that state their meaning |
//! | `centre`, `estimator`, `remote`, `saved`, `revised` | the centre, its half of a sensor, states to which it returns |
//! | `band` | the band of an estimate |
//! | `followed` | noise that changes while rows come |
//! | `summary` | what was found over all rows |

mod band;
mod centre;
mod doubts;
pub(crate) mod estimator;
mod followed;
mod found;
pub(crate) mod hints;
mod later;
mod meaning;
mod open;
pub(crate) mod options;
mod remote;
mod repeating;
pub(crate) mod report;
mod revised;
mod saved;
mod settings;
mod stated;
pub(crate) mod summary;
mod world;

use crate::error::{Error, Failure};
use crate::first::stuck::Stuck;
use crate::rows::instant::Instant;
use crate::rows::rhythm::Rhythm;
use crate::rows::{Instants, Rows};
use centre::centre;
use estimator::{Estimator, Event, LevelRow, Revision, Use};
use followed::{Followed, Shift};
use hints::Turning;
use meaning::Seat;
use options::LevelOptions;
use settings::Settings;
use summary::{LevelSummary, SensorSummary};

/// First rows from which it is found which columns report less often than rows come.
const RHYTHM_ROWS: usize = 200;
const REFUSED: &str = "the model is refused";

/// The estimate of a level, row by row.
///
/// What no option states is found from the first rows: noise of each sensor, change of the level, offsets of rounding, limits, angles. Sensors that
/// fail, repeat one value or contradict the others are left out, and [`finish`](Self::finish) says so.
pub struct LevelTracker {
    settings: Settings,
    purpose: Use,
    /// Names of the sensors that have joined.
    names: Vec<String>,
    centre: Box<dyn Estimator>,
    /// The same sensors without quantization.
    full: Option<Box<dyn Estimator>>,
    squares: f64,
    summary: LevelSummary,
    /// The noise of sensors as rows show it.
    followed: Option<Followed>,
    turning: Turning,
    stuck: Option<Stuck>,
    rhythm: Option<Rhythm>,
    /// What happened since the last row.
    between: Vec<Event>,
    /// Of each instant so far, if estimates are kept: whether it is a row.
    are_rows: Option<Vec<bool>>,
}

impl LevelTracker {
    /// A tracker for these rows. Reads as many first rows ahead as it needs to find what `options` do not state, up to 2000; of a live source no more
    /// than that.
    ///
    /// # Errors
    /// If a row cannot be read, a number is out of its range, or the first rows do not tell what is not stated.
    pub fn new<R: Rows>(options: &LevelOptions, rows: &mut Instants<R>) -> Result<Self, Error> {
        let mut settings = Settings::find(options, rows)?;
        let has_transform = rows.options().transform.is_some();
        let turning = Turning::new(options, has_transform, settings.world.period);
        let stuck = (!options.reports && options.silent_within.is_none()).then(Stuck::default);
        let purpose = if options.reports {
            Use::Reports
        } else {
            Use::Measurements
        };
        let is_quantized = !options.reports && settings.has_bits(rows.names());
        settings.world.is_followed = !options.reports
            && !is_quantized
            && settings.lasting.is_none()
            && !settings.world.is_on_change
            && options.learning != Some(false);
        let full = is_quantized
            .then(|| centre(&settings.world, Use::Comparison))
            .transpose();
        let mut centre = centre(&settings.world, purpose).map_err(Error::refused(REFUSED))?;
        if let Some(lasting) = &settings.lasting {
            centre.under(lasting);
        }
        // Silence of a sensor that sends on change is no missing report.
        let rhythm = if options.silent_within.is_some() {
            None
        } else if rows.options().single_reports {
            Some(Rhythm::default())
        } else {
            // Of a live source no row is waited for.
            let first = if rows.source().is_live() { 0 } else { RHYTHM_ROWS };
            Some(Rhythm::of_columns(rows.names().len(), rows.peek(first)?))
        };
        Ok(Self {
            purpose,
            names: Vec::new(),
            centre,
            full: full.map_err(Error::refused(REFUSED))?,
            squares: 0.0,
            summary: LevelSummary::new(&settings),
            followed: settings.world.is_followed.then(Followed::default),
            turning,
            stuck,
            rhythm,
            between: Vec::new(),
            are_rows: options.smooth.then(Vec::new),
            settings,
        })
    }

    /// Processes an instant, in the order of time. `names`: of the sensors so far, [`Instants::names`]. Without a result of one that is no row.
    ///
    /// # Errors
    /// If the time is before that of the last instant, a report is of no sensor or is none that its sensor sends: the tracker is then as it was.
    pub fn step(&mut self, names: &[String], instant: &Instant) -> Result<Option<LevelRow>, Error> {
        if let Some((sensor, _)) = instant.reports.iter().find(|(sensor, _)| *sensor >= names.len()) {
            return Err(Error::Content {
                row: instant.row,
                problem: format!("a report of sensor {sensor}: there are {}, counted from 0", names.len()),
            });
        }
        if !instant.is_row {
            let row = self.advance(instant)?;
            self.learn(names, instant);
            self.between.extend(row.events);
            // It has no row of its own.
            self.are_rows.iter_mut().for_each(|rows| rows.push(false));
            return Ok(None);
        }
        let mut instant = instant.clone();
        let rhythm = self.rhythm.clone();
        if let Some(rhythm) = &mut self.rhythm {
            rhythm.fill(&mut instant);
        }
        let found = self.join(names, instant.row).and_then(|()| self.advance(&instant));
        let mut row = found.inspect_err(|_| self.rhythm = rhythm)?;
        self.follow(&instant, &mut row);
        row.events.splice(0..0, std::mem::take(&mut self.between));
        self.squares += row.full.map_or(0.0, |full| (full - row.estimate[0].0).powi(2));
        self.summary.add(&instant, &row, &self.names);
        self.learn(names, &instant);
        self.are_rows.iter_mut().for_each(|rows| rows.push(true));
        self.turning.add(&instant);
        if let Some(stuck) = &mut self.stuck {
            stuck.add(&instant);
        }
        Ok(Some(row))
    }

    /// Adds sensors when they first occur.
    fn join(&mut self, names: &[String], row: u64) -> Result<(), Error> {
        for (sensor, name) in names.iter().enumerate().skip(self.centre.seated()) {
            let seat = self.settings.seat(sensor, name);
            self.centre.join(seat.clone()).map_err(Error::row(row))?;
            if let Some(full) = &mut self.full {
                full.join(seat.clone()).map_err(Error::row(row))?;
            }
            self.summary
                .sensors
                .push(SensorSummary::new(name, seat.noise, seat.offset));
            self.names.push(name.clone());
        }
        Ok(())
    }

    /// Processes an instant in both centres, or in none.
    fn advance(&mut self, instant: &Instant) -> Result<LevelRow, Error> {
        let mut row = self.centre.step(instant).map_err(Error::row(instant.row))?;
        if let Some(full) = &mut self.full {
            let found = full.step(instant).inspect_err(|_| self.centre.undo());
            row.full = Some(found.map_err(Error::row(instant.row))?.estimate[0].0);
        }
        Ok(row)
    }

    /// Finds change and noise again if enough rows have come. All rows so far are then gone through anew. What gives no valid model is not taken.
    fn learn(&mut self, names: &[String], instant: &Instant) {
        let Some(mut later) = self.settings.later.take() else {
            return;
        };
        let (rows, (unknown, first)) = (later.add(instant).map(<[_]>::to_vec), later.unknown());
        if let Some(rows) = rows {
            let before = self.settings.clone();
            let is_taken =
                self.settings.find_again((&rows[..first], &rows), names, unknown) && self.restart(&rows).is_ok();
            if !is_taken {
                self.settings = before;
            }
        }
        self.settings.later = Some(later).filter(|later| !later.is_done());
    }

    /// Goes through all rows so far under the present settings, or changes nothing.
    fn restart(&mut self, rows: &[Instant]) -> Result<(), Failure> {
        let names = self.names.iter().enumerate();
        let seats: Vec<Seat> = names.map(|(sensor, name)| self.settings.seat(sensor, name)).collect();
        let again = |purpose: Use| {
            let mut centre = centre(&self.settings.world, purpose)?;
            self.settings.lasting.iter().for_each(|lasting| centre.under(lasting));
            seats.iter().try_for_each(|seat| centre.join(seat.clone()))?;
            rows.iter().try_for_each(|row| centre.step(row).map(|_| ()))?;
            Ok::<_, Failure>(centre)
        };
        let full = self.full.is_some().then(|| again(Use::Comparison)).transpose()?;
        (self.centre, self.full) = (again(self.purpose)?, full);
        let followed = self.followed.take().filter(|_| self.settings.lasting.is_none());
        self.followed = followed.map(|_| Followed::default());
        self.summary.noise = self.settings.noise;
        self.summary.change = self.settings.world.change;
        for (sensor, seat) in self.summary.sensors.iter_mut().zip(&seats) {
            sensor.noise = seat.noise;
        }
        Ok(())
    }

    /// Looks whether the noise of sensors is another than supposed. If so, rows are gone through anew from where it changed.
    fn follow(&mut self, instant: &Instant, row: &mut LevelRow) {
        let Some(followed) = &mut self.followed else { return };
        let (settings, names) = (&self.settings, &self.names);
        let sensors = self.summary.sensors.iter().enumerate();
        let all: Vec<f64> = sensors.map(|(sensor, one)| followed.noise(sensor, one.noise)).collect();
        let used: Vec<bool> = (0..all.len()).map(|sensor| self.centre.health(sensor).1).collect();
        let is_followed = |sensor: usize| used[sensor] && settings.step_of(sensor).is_none();
        let noise = |(sensor, noise): (usize, &f64)| is_followed(sensor).then_some(*noise);
        let noises: Vec<Option<f64>> = all.iter().enumerate().map(noise).collect();
        followed.add(instant, row, settings, &noises);
        let Some(Shift {
            mut noises,
            rows,
            scale,
        }) = followed.shift(settings, names, &all, &used, row.noise_scale)
        else {
            return;
        };
        // What is stated is kept.
        noises.retain(|(sensor, _)| settings.noises.of(&names[*sensor]).is_none());
        if noises.is_empty() && scale.is_none() {
            return;
        }
        let last: Vec<Instant> = followed.last().cloned().collect();
        let revision = Revision {
            noises,
            scale,
            instants: rows.len(),
            last: &last,
        };
        let Ok(revised) = self.centre.revise(&revision) else {
            // What is supposed stays.
            followed.forget(&revision.noises);
            return;
        };
        followed.take(&revision.noises);
        self.settings.later = None;
        let events = revision.noises.iter();
        let mut events: Vec<Event> = events.map(|(sensor, _)| ("noise changed", Some(*sensor))).collect();
        let full = row.full;
        if let Some(revised) = revised {
            *row = revised;
        }
        row.full = full;
        row.events.append(&mut events);
    }

    /// Whole periods that are taken off a level to write it within one period; 0 of a level that is no angle.
    pub fn turns(&self, level: f64) -> f64 {
        let turns = |circle: settings::Circle| circle.period * ((level - circle.low) / circle.period).floor();
        self.settings.circle.map_or(0.0, turns)
    }

    /// The estimates of all rows given all rows, or those up to so many seconds later, as [`LevelRow::estimate`]. [`LevelOptions::smooth`] keeps what it
    /// takes; without it there are none.
    ///
    /// # Errors
    /// If a covariance cannot be inverted.
    pub fn smoothed(&self, lag: Option<f64>) -> Result<Vec<Vec<(f64, f64)>>, Error> {
        let what = "the estimates cannot be smoothed";
        let smoothed = self.centre.smoothed(lag).map_err(Error::refused(what))?;
        let rows = smoothed.into_iter().zip(self.are_rows.iter().flatten());
        Ok(rows
            .filter(|(_, is_row)| **is_row)
            .map(|(estimate, _)| estimate)
            .collect())
    }

    /// What was found over all rows. `rows`: those that the tracker was fed.
    pub fn finish<R: Rows>(mut self, rows: &Instants<R>) -> LevelSummary {
        let (summary, names) = (&mut self.summary, rows.names());
        summary.copies = rows.copies();
        if rows.options().numbered {
            let hint = "no column has times: rows count as a second apart; if one has, name it with --time-column";
            summary.hints.push(hint.to_owned());
        }
        summary.hints.extend(rows.told());
        summary.hints.extend(self.settings.lines_of_found(names));
        let changes = |followed: &Followed| followed.hints(&self.settings, names);
        summary.hints.extend(self.followed.iter().flat_map(changes));
        let followed = self.followed.as_ref();
        let has_changed = |sensor: usize| followed.is_some_and(|followed| followed.has_changed(sensor));
        summary.hints.extend(self.turning.hints(names, has_changed));
        summary
            .hints
            .extend(self.stuck.iter().flat_map(|stuck| stuck.hints(names)));
        let count = summary.rows.max(1) as f64;
        summary.bits_per_report = summary.bits as f64 / (summary.reports as f64).max(1.0);
        summary.difference_from_full_values = self.full.as_ref().map(|_| (self.squares / count).sqrt());
        for (number, sensor) in summary.sensors.iter_mut().enumerate() {
            (sensor.working, sensor.used) = self.centre.health(number);
            sensor.rejected = self.centre.rejected(number);
            sensor.surprise = self.centre.surprise(number);
        }
        self.summary
    }
}
