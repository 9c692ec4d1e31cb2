//! `fewbits track`: a fusion centre over a table.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows` | the table as instants |
//! | `sensors` | what a sensor sends, at both ends |
//! | `centre` | the centre of a level |
//! | `settings` | what options and first rows say |
//! | `level`, `ranges` | the two tasks: a level, a place in the plane |

mod centre;
mod level;
mod ranges;
mod rows;
mod sensors;
pub(crate) mod settings;

use crate::Ending;
use crate::arguments::{Model, TrackOptions};
use crate::error::Error;
use crate::output::Cell;
use rows::Instants;

/// Deviations to either side of a mean that hold 95 % of a normal law.
const BAND: f64 = 1.96;

/// Runs the task.
pub(crate) fn run(options: &TrackOptions) -> Result<Ending, Error> {
    let instants = Instants::open(options)?;
    match (options.model, &options.anchors) {
        (Model::Ranges, Some(anchors)) => ranges::run(options, anchors, instants),
        (_, Some(_)) => Err(Error::Needed {
            option: "--model ranges",
            reason: "--anchors says where ranges are measured from",
        }),
        _ => level::run(options, instants),
    }
}

/// The first cell of a row: time or number.
fn first_cell(instants: &Instants, time: String) -> Cell {
    if instants.has_time() {
        Cell::Text(time)
    } else {
        time.parse().map_or(Cell::Text(time), Cell::Whole)
    }
}

/// The name of the first cell.
fn first_name(instants: &Instants) -> &'static str {
    if instants.has_time() { "time" } else { "row" }
}

/// Prints a summary: as JSON or as lines.
fn summarise(summary: &impl serde::Serialize, lines: &[String], json: bool) -> Result<(), Error> {
    if json {
        serde_json::to_writer(std::io::stderr(), summary)?;
        eprintln!();
    } else {
        lines.iter().for_each(|line| eprintln!("{line}"));
    }
    Ok(())
}
