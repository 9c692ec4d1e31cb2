//! `fewbits track`: a fusion centre over a table.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows` | the table as instants |
//! | `sensors` | reports as options and tables have them |
//! | `centre` | the centre of a level |
//! | `settings` | what options and first rows say |
//! | `rhythm` | silence in a table of single reports |
//! | `report` | first cell of a row, summary |
//! | `level`, `ranges` | the two tasks: a level, a place in the plane |

mod centre;
mod level;
mod ranges;
mod report;
mod rhythm;
mod rows;
mod sensors;
mod settings;

use crate::Ending;
use crate::arguments::{Model, TrackOptions};
use crate::error::Error;
use rows::Instants;

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
