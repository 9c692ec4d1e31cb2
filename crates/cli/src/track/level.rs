//! Tracking of a level that sensors measure: estimates with bands, row by row.

use super::centre::centre;
use super::estimator::{Estimator, Step, Use};
use super::followed::{Followed, Shift};
use super::hints::Turning;
use super::instant::Instant;
use super::meaning::Seat;
use super::picture::{Drawn, Picked};
use super::report::{Shown, cells, events, first_cell, first_name, summarise};
use super::rhythm::Rhythm;
use super::rows::Instants;
use super::settings::Settings;
use super::stuck::Stuck;
use super::summary::{EventSummary, SensorSummary, Summary, lines};
use crate::Ending;
use crate::arguments::{Model, Switch, TrackOptions};
use crate::error::{Error, Failure};
use crate::output::{Shape, Sheet};
use crate::plot::{Picture, Thinned};

/// Largest number of events in the summary.
const MAX_EVENTS: usize = 1000;

/// An event, and its sensor.
type Happened = (&'static str, Option<usize>);

/// Both centres, and the counts for the summary.
struct Run {
    settings: Settings,
    file: String,
    purpose: Use,
    centre: Box<dyn Estimator>,
    /// The same sensors without quantization.
    full: Option<Box<dyn Estimator>>,
    squares: f64,
    summary: Summary,
    drawn: Drawn,
    /// The noise of sensors as rows show it.
    followed: Option<Followed>,
}

impl Run {
    fn new(options: &TrackOptions, mut settings: Settings, instants: &Instants) -> Result<Self, Error> {
        let refused = |source: Failure| Error::Refused {
            what: "the model is refused",
            source,
        };
        let purpose = if options.reports {
            Use::Reports
        } else {
            Use::Measurements
        };
        let is_quantized = !options.reports && settings.has_bits(&instants.names);
        settings.world.is_followed = !options.reports
            && !is_quantized
            && settings.lasting.is_none()
            && !settings.world.is_on_change
            && options.learning != Some(Switch::Off);
        let full = is_quantized
            .then(|| centre(&settings.world, Use::Comparison))
            .transpose();
        let mut centre = centre(&settings.world, purpose).map_err(refused)?;
        if let Some(lasting) = &settings.lasting {
            centre.under(lasting);
        }
        Ok(Self {
            purpose,
            centre,
            full: full.map_err(refused)?,
            file: instants.file().to_owned(),
            squares: 0.0,
            summary: Summary {
                rows: 0,
                copies: 0,
                reports: 0,
                bits: 0,
                bits_per_report: 0.0,
                noise: settings.noise,
                change: settings.world.change,
                within: settings.world.within,
                noise_scale: 1.0,
                difference_from_full_values: None,
                sensors: Vec::new(),
                events: Vec::new(),
                is_silence_said: settings.meaning.silent_within.is_some(),
                hints: settings.hints.clone(),
            },
            followed: settings.world.is_followed.then(Followed::default),
            settings,
            drawn: Drawn {
                path: Thinned::new(),
                measured: Thinned::new(),
            },
        })
    }

    /// Processes an instant without a row; its events.
    fn between(&mut self, instant: &Instant, names: &[String]) -> Result<Vec<Happened>, Error> {
        let refused = |source: Failure| Error::Row {
            file: self.file.clone(),
            row: instant.row,
            source,
        };
        if let Some(full) = &mut self.full {
            full.step(instant).map_err(refused)?;
        }
        let events = self.centre.step(instant).map_err(refused)?.events;
        self.learn(instant, names)?;
        Ok(events)
    }

    /// Finds change and noise again if enough rows have come. All rows so far are then gone through anew.
    fn learn(&mut self, instant: &Instant, names: &[String]) -> Result<(), Error> {
        let Some(mut later) = self.settings.later.take() else {
            return Ok(());
        };
        let (rows, (unknown, first)) = (later.add(instant).map(<[_]>::to_vec), later.unknown());
        let again = rows.filter(|rows| self.settings.find_again((&rows[..first], rows), names, unknown));
        if let Some(rows) = again {
            let refused = |source: Failure| Error::Refused {
                what: "the model is refused",
                source,
            };
            let seats: Vec<Seat> = names[..self.centre.seated()]
                .iter()
                .enumerate()
                .map(|(sensor, name)| self.settings.seat(sensor, name))
                .collect();
            let again = |purpose: Use| {
                let mut centre = centre(&self.settings.world, purpose)?;
                self.settings.lasting.iter().for_each(|lasting| centre.under(lasting));
                seats.iter().try_for_each(|seat| centre.join(seat.clone()))?;
                rows.iter().try_for_each(|row| centre.step(row).map(|_| ()))?;
                Ok(centre)
            };
            self.centre = again(self.purpose).map_err(refused)?;
            let followed = self.followed.take().filter(|_| self.settings.lasting.is_none());
            self.followed = followed.map(|_| Followed::default());
            if self.full.is_some() {
                self.full = Some(again(Use::Comparison).map_err(refused)?);
            }
            self.summary.noise = self.settings.noise;
            self.summary.change = self.settings.world.change;
            for (sensor, seat) in self.summary.sensors.iter_mut().zip(&seats) {
                sensor.noise = seat.noise;
            }
        }
        self.settings.later = Some(later).filter(|later| !later.is_done());
        Ok(())
    }

    /// Processes a row, whose events come after those `before`.
    fn step(&mut self, instant: &Instant, names: &[String], before: Vec<Happened>) -> Result<Step, Error> {
        let file = self.file.clone();
        let refused = |source: Failure| Error::Row {
            file: file.clone(),
            row: instant.row,
            source,
        };
        // In a table of reports a sensor is added when it first occurs.
        for (sensor, name) in names.iter().enumerate().skip(self.centre.seated()) {
            let seat = self.settings.seat(sensor, name);
            self.centre.join(seat.clone()).map_err(refused)?;
            if let Some(full) = &mut self.full {
                full.join(seat.clone()).map_err(refused)?;
            }
            self.summary.sensors.push(SensorSummary {
                name: name.clone(),
                reports: 0,
                gaps: 0,
                rejected: 0,
                surprise: None,
                noise: seat.noise,
                offset: seat.offset,
                working: 1.0,
                used: true,
            });
        }
        let mut step = self.centre.step(instant).map_err(refused)?;
        self.follow(instant, names, &mut step)?;
        step.events.splice(0..0, before);
        let full = self
            .full
            .as_mut()
            .map(|full| full.step(instant))
            .transpose()
            .map_err(refused)?;
        let summary = &mut self.summary;
        summary.rows += 1;
        summary.reports += step.reports;
        summary.bits += step.bits;
        summary.noise_scale = step.noise_scale;
        for (sensor, cell) in &instant.reports {
            match cell {
                Some(_) => summary.sensors[*sensor].reports += 1,
                None => summary.sensors[*sensor].gaps += 1,
            }
        }
        for (event, sensor) in &step.events {
            if summary.events.len() < MAX_EVENTS {
                summary.events.push(EventSummary {
                    time: instant.time.clone(),
                    event,
                    sensor: sensor.map(|sensor| names[sensor].clone()),
                });
            }
        }
        let full = full.map(|full| full.estimate[0].0);
        self.squares += full.map_or(0.0, |full| (full - step.estimate[0].0).powi(2));
        self.drawn.path.push(Picked {
            seconds: instant.seconds,
            estimate: step.estimate[0],
            full,
        });
        self.learn(instant, names)?;
        Ok(step)
    }

    /// Looks whether the noise of sensors is another than supposed. If so, rows are gone through anew from where it changed.
    fn follow(&mut self, instant: &Instant, names: &[String], step: &mut Step) -> Result<(), Error> {
        let Some(followed) = &mut self.followed else {
            return Ok(());
        };
        let settings = &self.settings;
        let sensors = self.summary.sensors.iter().enumerate();
        let all: Vec<f64> = sensors.map(|(sensor, one)| followed.noise(sensor, one.noise)).collect();
        let used: Vec<bool> = (0..all.len()).map(|sensor| self.centre.health(sensor).1).collect();
        let is_followed = |sensor: usize| used[sensor] && settings.step_of(sensor).is_none();
        let noise = |(sensor, noise): (usize, &f64)| is_followed(sensor).then_some(*noise);
        let noises: Vec<Option<f64>> = all.iter().enumerate().map(noise).collect();
        followed.add(instant, step, settings, &noises);
        let Some(Shift {
            mut noises,
            rows,
            scale,
        }) = followed.shift(settings, names, &all, &used, step.noise_scale)
        else {
            return Ok(());
        };
        // What is stated is kept.
        noises.retain(|(sensor, _)| settings.noises.of(&names[*sensor]).is_none());
        if noises.is_empty() && scale.is_none() {
            return Ok(());
        }
        self.settings.later = None;
        let refused = |source: Failure| Error::Row {
            file: self.file.clone(),
            row: instant.row,
            source,
        };
        followed.take(&noises);
        self.centre.set_noises(&noises).map_err(refused)?;
        let events = noises.iter().map(|(sensor, _)| ("noise changed", Some(*sensor)));
        let mut events: Vec<Happened> = events.collect();
        let back = self.centre.back(rows.len());
        if let Some(scale) = scale {
            self.centre.rescale(scale).map_err(refused)?;
        }
        for row in followed.last(back.unwrap_or(0)) {
            *step = self.centre.step(row).map_err(refused)?;
        }
        step.events.append(&mut events);
        Ok(())
    }

    fn finish(mut self, options: &TrackOptions) -> Result<(Summary, Picture), Error> {
        let rows = self.summary.rows.max(1) as f64;
        self.summary.bits_per_report = self.summary.bits as f64 / (self.summary.reports as f64).max(1.0);
        self.summary.difference_from_full_values = self.full.as_ref().map(|_| (self.squares / rows).sqrt());
        for (number, sensor) in self.summary.sensors.iter_mut().enumerate() {
            (sensor.working, sensor.used) = self.centre.health(number);
            sensor.rejected = self.centre.rejected(number);
            sensor.surprise = self.centre.surprise(number);
        }
        let title =
            format!("{}: {} rows, {:.2} bits per report", self.file, self.summary.rows, self.summary.bits_per_report);
        let picture = self.drawn.picture(options, title, self.full.is_some());
        Ok((self.summary, picture))
    }
}

/// First rows from which it is found which columns report less often than rows come.
const RHYTHM_ROWS: usize = 200;

/// Runs the task.
pub(super) fn run(options: &TrackOptions, mut instants: Instants) -> Result<Ending, Error> {
    let settings = Settings::find(options, &mut instants)?;
    let parts: &[&str] = match options.model {
        Some(Model::Velocity) => &["level", "slope"],
        Some(Model::Acceleration) => &["level", "slope", "curvature"],
        _ => &["level"],
    };
    let columns = parts
        .iter()
        .flat_map(|part| [(*part).to_owned(), format!("{part}_low"), format!("{part}_high")]);
    let last = ["reports", "rejected", "bits", "sensors_used", "noise_scale", "events"].map(str::to_owned);
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(columns)
        .chain(last);
    let shown = Shown {
        circle: settings.circle,
        transform: options.transform,
        coordinates: parts.len(),
    };
    let value = |number: f64| options.transform.map_or(number, |transform| transform.inverse(number));
    let mut turning = Turning::new(options, settings.world.period);
    let mut stuck = (!options.reports && options.silent_within.is_none()).then(Stuck::default);
    let mut run = Run::new(options, settings, &instants)?;
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names.collect())?;
    let lag = options.smooth.as_deref().map(lag).transpose()?;
    // Silence of a sensor that sends on change is no missing report.
    let mut rhythm = match (&options.table.by, &options.silent_within) {
        (_, Some(_)) => None,
        (Some(_), None) => Some(Rhythm::default()),
        // Of a pipe no row is waited for.
        (None, None) => {
            let (columns, rows) = (instants.names.len(), if instants.is_live() { 0 } else { RHYTHM_ROWS });
            Some(Rhythm::of_columns(columns, instants.peek(rows)?))
        }
    };
    let (mut waiting, mut between) = (Vec::new(), Vec::new());
    while let Some(mut instant) = instants.next()? {
        if !instant.is_row {
            between.extend(run.between(&instant, &instants.names)?);
            // It has no row of its own.
            if lag.is_some() {
                waiting.push(None);
            }
            continue;
        }
        if let Some(rhythm) = &mut rhythm {
            rhythm.fill(&mut instant);
        }
        let step = run.step(&instant, &instants.names, std::mem::take(&mut between))?;
        turning.add(&instant);
        if let Some(stuck) = &mut stuck {
            stuck.add(&instant);
        }
        if !options.reports {
            let values = instant
                .reports
                .iter()
                .filter_map(|(_, cell)| *cell)
                .filter(|cell| cell.is_finite());
            values.for_each(|number| run.drawn.measured.push((instant.seconds, value(number))));
        }
        let first = first_cell(&instants, instant.time.clone());
        let events = events(&step, &instants.names);
        if lag.is_some() {
            waiting.push(Some((first, step, events)));
        } else {
            sheet.write(cells(shown, first, &step.estimate, &step, events))?;
            if instants.is_live() {
                sheet.flush()?;
            }
        }
    }
    if let Some(lag) = lag {
        let smoothed = run.centre.smoothed(lag).map_err(|source| Error::Refused {
            what: "the estimates cannot be smoothed",
            source,
        })?;
        for (row, estimate) in waiting.into_iter().zip(&smoothed) {
            let Some((first, step, events)) = row else { continue };
            sheet.write(cells(shown, first, estimate, &step, events))?;
        }
    }
    sheet.finish()?;
    run.summary.copies = instants.copies;
    if !instants.has_time() {
        let hint = "no column has times: rows count as a second apart; if one has, name it with --time-column";
        run.summary.hints.push(hint.to_owned());
    }
    run.summary.hints.extend(instants.strange_accuracies());
    run.summary.hints.extend(run.settings.lines_of_found(&instants.names));
    let changes = |followed: &Followed| followed.hints(&run.settings, &instants.names);
    run.summary.hints.extend(run.followed.iter().flat_map(changes));
    let followed = run.followed.as_ref();
    let has_changed = |sensor: usize| followed.is_some_and(|followed| followed.has_changed(sensor));
    run.summary.hints.extend(turning.hints(&instants.names, has_changed));
    let stuck = stuck.iter().flat_map(|stuck| stuck.hints(&instants.names));
    run.summary.hints.extend(stuck);
    let (summary, picture) = run.finish(options)?;
    if let Some(path) = &options.plot {
        picture.save(path)?;
    }
    summarise(&summary, &lines(&summary), options.json)?;
    Ok(Ending::Good)
}

/// Parses `all`, or a time as `30s`: the time after which rows no longer count.
fn lag(text: &str) -> Result<Option<f64>, Error> {
    if text == "all" {
        return Ok(None);
    }
    const EXPECTED: &str = "`all`, or a time, as `30s`";
    let time = humantime::parse_duration(text).map_err(|_| Error::option("--smooth", text, EXPECTED))?;
    Ok(Some(time.as_secs_f64()))
}
