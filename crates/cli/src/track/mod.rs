//! `fewbits track`: a fusion centre over a table.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows`, `columns`, `own_columns` | the table as instants, which of its columns are no sensors |
//! | `sensors` | reports as options and tables have them |
//! | `centre`, `estimator`, `remote` | the centre of a level, its half of a sensor |
//! | `meaning` | what the cells of a sensor mean |
//! | `settings` | what options and first rows say |
//! | `first` | values of the first rows |
//! | `found` | what is found from the first rows |
//! | `later` | the same again while rows come |
//! | `hints` | what the first rows suggest that no option says |
//! | `doubts` | what the values say against the stated noise |
//! | `followed` | noise that changes while rows come |
//! | `lasting` | errors that last from row to row |
//! | `groups`, `lags` | groups of sensors of different levels, sensors that come late |
//! | `transform` | roots and logarithms of values |
//! | `stuck`, `held`, `constant`, `derived` | sensors that repeat one value, columns that hold values, never vary, or are computed from others |
//! | `limits`, `marks`, `units` | detection limits, numbers that stand for gaps, changes of the unit |
//! | `late` | rows that come late |
//! | `rhythm` | silence in a table of single reports |
//! | `report` | first cell of a row, summary |
//! | `applied` | what `fit` found, as settings |
//! | `fit` | the task `fit`: calibration |
//! | `level`, `picture` | the task `track`: a level, and its picture |
//! | `ranges` | the task `ranges`: a place |
//! | `anchors`, `odometry`, `path` | the table of its anchors, the columns of what the target moved, the picture |
//! | `leak`, `leak_rooms` | the task `leak`: a room, and the file of rooms |
//! | `range_summary` | what it says of a track |
//! | `range_settings` | its options as settings, the law of signal strengths |
//! | `targets` | several targets in one table |
//! | `accuracies` | accuracies that its rows state |
//! | `told` | what its first ranges tell: height, and errors that grow |

mod accuracies;
mod anchors;
pub(crate) mod applied;
mod centre;
mod columns;
mod constant;
mod derived;
mod divisor;
mod doubts;
mod estimator;
mod faults;
mod first;
mod fit;
mod followed;
mod found;
mod groups;
mod held;
mod hints;
mod instant;
mod lags;
mod lasting;
mod late;
mod later;
mod leak;
mod leak_rooms;
mod level;
mod limits;
mod marks;
mod meaning;
mod mistakes;
mod odometry;
mod open;
mod own_columns;
mod path;
mod picture;
mod range_settings;
mod range_summary;
mod ranges;
mod remote;
mod report;
mod rhythm;
mod rows;
mod samples;
mod seconds;
mod sensors;
mod settings;
mod stuck;
mod summary;
mod target;
mod targets;
mod told;
mod transform;
mod units;
mod world;

pub(crate) use transform::Transform;

use crate::Ending;
use crate::arguments::{FitOptions, LeakOptions, Model, RangesOptions, TrackOptions};
use crate::error::Error;
use crate::output::Sheet;
use crate::table_options::TableOptions;
use columns::{Finds, Kind};
use fewbits_table::names::as_argument;
use rows::Instants;
use target::Target;

/// Runs the task.
pub(crate) fn run(options: &TrackOptions) -> Result<Ending, Error> {
    match (options.model, &options.anchors) {
        (Some(Model::Ranges), Some(anchors)) => ranges(&range_settings::options(options, anchors)?),
        (_, Some(_)) => Err(Error::Needed {
            option: "--model ranges",
            reason: "--anchors says where ranges are measured from",
        }),
        _ => {
            let instants = Instants::open(&options.table, &Kind::of(options)?)?;
            let mut options = options.clone();
            options.table.by.clone_from(&instants.roles.by);
            options.accuracy_column = instants.roles.any_accuracy().cloned();
            let (options, corrections) = applied::applied(&options, &instants.names)?;
            check_transform(&options)?;
            level::run(&options, instants.corrected(corrections, options.transform))
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
    fit::run(options)
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
        let mut instants = Instants::open(table, &kind)?;
        let mut options = options.clone();
        options.table.by.clone_from(&instants.roles.by);
        instants.only = of.as_ref().map(|target| target.rows.clone());
        ranges::run(&options, &anchors, instants, of.as_ref(), output)
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
