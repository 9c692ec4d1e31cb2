//! `fewbits track`: a fusion centre over a table.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows`, `columns`, `own_columns`, `accuracies`, `seconds` | the table as a source of rows, which of its columns are no sensors, what accuracies state, its times |
//! | `report` | first cell of a row, summary |
//! | `level`, `level_options`, `picture` | the task `track`: a sheet of a level, its options, its picture |
//! | `range_rows`, `range_options`, `path` | the task `ranges`: a sheet of places, its options, its picture |
//! | `anchors`, `target`, `targets` | the table of anchors, several targets in one table |
//! | `leak` | the task `leak`: a room, and the file of rooms |
//! | `calibration`, `faults` | the task `fit`: calibration, its file, what it says of faults |
//!
//! What is estimated, and what is told of it, is `fewbits_tracking`.

mod accuracies;
mod anchors;
pub(crate) mod calibration;
mod columns;
mod faults;
mod leak;
mod level;
mod level_options;
mod own_columns;
mod path;
mod picture;
mod range_options;
mod range_rows;
mod report;
mod rows;
mod seconds;
mod target;
mod targets;

use crate::Ending;
use crate::arguments::{FitOptions, LeakOptions, RangesOptions};
use crate::error::Error;
use crate::output::Sheet;
use crate::table_options::TableOptions;
use crate::track_options::{Model, TrackOptions};
use columns::{Finds, Kind};
use fewbits_table::names::as_argument;
use target::Target;

/// Runs the task.
pub(crate) fn run(options: &TrackOptions) -> Result<Ending, Error> {
    match (options.model, &options.anchors) {
        (Some(Model::Ranges), Some(anchors)) => ranges(&range_options::options(options, anchors)?),
        (_, Some(_)) => Err(Error::Needed {
            option: "--model ranges",
            reason: "--anchors says where ranges are measured from",
        }),
        _ => {
            let instants = rows::open(&options.table, &level_options::kind(options)?, None)?;
            let mut options = options.clone();
            let roles = &instants.source().roles;
            options.table.by.clone_from(&roles.by);
            options.accuracy_column = roles.any_accuracy().cloned();
            check_transform(&options)?;
            level::run(&options, instants)
        }
    }
}

/// Refuses options that a transform does not go with.
fn check_transform(options: &TrackOptions) -> Result<(), Error> {
    let has_slope = matches!(options.model, Some(Model::Velocity | Model::Acceleration));
    let reason = match (options.transform, has_slope, &options.accuracy_column) {
        (Some(_), true, _) => {
            "with --transform the model is that of a level: `walk` or `returning` is expected, or --model left out"
        }
        (Some(_), _, Some(_)) => {
            "accuracies are those of values, not of what --transform makes of them: name the sensors by --columns"
        }
        _ => return Ok(()),
    };
    Err(Error::Needed {
        option: if has_slope { "--model walk" } else { "--columns" },
        reason,
    })
}

/// Runs the task `fit`.
pub(crate) fn fit(options: &FitOptions) -> Result<Ending, Error> {
    calibration::run(options)
}

/// Runs the task `leak`.
pub(crate) fn leak(options: &LeakOptions) -> Result<Ending, Error> {
    leak::run(options)
}

/// Runs the task `ranges`.
pub(crate) fn ranges(options: &RangesOptions) -> Result<Ending, Error> {
    let kind = Kind {
        finds: Finds::Anchors,
        by: options.table.by.clone(),
        accuracy: options.accuracy_column.clone(),
        late: options.late.map_or(0.0, |late| late.as_secs_f64()),
        ..Kind::default()
    };
    let mut table = options.table.clone();
    if table.by.is_none() && !table.columns.is_empty() {
        table.columns.extend(options.odometry.iter().cloned());
    }
    let anchors = anchors::read_anchors(&options.anchors)?;
    let run = |table: &TableOptions, of: Option<Target>, output: &mut Option<Sheet>| {
        let instants = rows::open(table, &kind, of.as_ref().map(|target| target.rows.clone()))?;
        let mut options = options.clone();
        options.table.by.clone_from(&instants.source().roles.by);
        range_rows::run(&options, &anchors, instants, of.as_ref(), output)
    };
    let mut output = None;
    let Some(column) = &options.target else {
        targets::refuse_several(&table, &anchors)?;
        run(&table, None, &mut output)?;
        return Ok(Ending::Good);
    };
    if options.plot.is_some() {
        return Err(Error::content("--plot", "several targets have no picture: do one without --target"));
    }
    let targets = targets::targets(&table, column)?;
    if table.columns.is_empty() {
        let mut without = table.without();
        without.push(column.clone());
        table.without = Some(as_argument(&without));
    }
    for of in targets {
        run(&table, Some(of), &mut output)?;
    }
    output.map_or(Ok(()), Sheet::finish)?;
    Ok(Ending::Good)
}
