//! Tracking of a level that sensors measure: a sheet of estimates with bands, row by row.

use super::calibration;
use super::level_options::level_options;
use super::picture::{Drawn, Picked};
use super::report::{Shown, cells, events, first_cell, first_name, summarise, value_of};
use super::rows::Instants;
use crate::Ending;
use crate::error::Error;
use crate::output::{Shape, Sheet};
use crate::plot::Thinned;
use crate::track_options::{Model, TrackOptions};
use fewbits_tracking::{LevelTracker, Rows};

/// Runs the task.
pub(super) fn run(options: &TrackOptions, instants: Instants) -> Result<Ending, Error> {
    let file = instants.source().file().to_owned();
    let refused = Error::tracking(&file);
    let found = options.settings.as_deref().map(calibration::read).transpose()?;
    let mut asked = level_options(options, &instants)?;
    let mut corrections = Vec::new();
    if let (Some(found), Some(path)) = (&found, &options.settings) {
        calibration::say_uncorrected(found, path, instants.names(), false);
        corrections = found.apply(&mut asked, instants.names());
    }
    let mut instants = instants.corrected(corrections, options.transform.map(Into::into));
    let mut tracker = LevelTracker::new(&asked, &mut instants).map_err(&refused)?;
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
        transform: options.transform,
        coordinates: parts.len(),
    };
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names.collect())?;
    let lag = options.smooth.as_deref().map(lag).transpose()?;
    let mut drawn = Drawn {
        path: Thinned::new(),
        measured: Thinned::new(),
    };
    let mut waiting = Vec::new();
    while let Some(instant) = instants.next().map_err(&refused)? {
        let Some(row) = tracker.step(instants.names(), &instant).map_err(&refused)? else {
            continue;
        };
        drawn.path.push(Picked {
            seconds: instant.seconds,
            estimate: row.estimate[0],
            full: row.full,
        });
        if !options.reports {
            let values = instant
                .reports
                .iter()
                .filter_map(|(_, cell)| *cell)
                .filter(|cell| cell.is_finite());
            let value = |number: f64| (instant.seconds, value_of(options.transform, number));
            values.for_each(|number| drawn.measured.push(value(number)));
        }
        let first = first_cell(&instants, instant.time);
        let events = events(&row, instants.names());
        if lag.is_some() {
            waiting.push((first, row, events));
        } else {
            sheet.write(cells(shown, first, &within_a_period(&tracker, &row.estimate), &row, events))?;
            if instants.source().is_live() {
                sheet.flush()?;
            }
        }
    }
    if let Some(lag) = lag {
        let smoothed = tracker.smoothed(lag).map_err(&refused)?;
        for ((first, row, events), estimate) in waiting.into_iter().zip(&smoothed) {
            sheet.write(cells(shown, first, &within_a_period(&tracker, estimate), &row, events))?;
        }
    }
    sheet.finish()?;
    let summary = tracker.finish(&instants);
    if let Some(path) = &options.plot {
        let title = format!("{file}: {} rows, {:.2} bits per report", summary.rows, summary.bits_per_report);
        drawn
            .picture(options, title, summary.difference_from_full_values.is_some())
            .save(path)?;
    }
    summarise(&summary, &summary.lines(), options.json)?;
    Ok(Ending::Good)
}

/// An estimate whose level, if it is an angle, is within one period.
fn within_a_period(tracker: &LevelTracker, estimate: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut estimate = estimate.to_vec();
    if let Some((level, _)) = estimate.first_mut() {
        *level -= tracker.turns(*level);
    }
    estimate
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
