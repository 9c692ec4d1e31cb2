//! `fewbits track`: a fusion centre over a table.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows` | the table as instants |
//! | `sensors` | reports as options and tables have them |
//! | `centre` | the centre of a level |
//! | `meaning` | what the cells of a sensor mean |
//! | `settings` | what options and first rows say |
//! | `rhythm` | silence in a table of single reports |
//! | `report` | first cell of a row, summary |
//! | `level` | the task `track`: a level |
//! | `ranges` | the task `ranges`: a place |

mod centre;
mod level;
mod meaning;
mod ranges;
mod report;
mod rhythm;
mod rows;
mod sensors;
mod settings;

use crate::Ending;
use crate::arguments::{Model, RangesOptions, TrackOptions};
use crate::error::Error;
use rows::{Instants, Kind};

/// Runs the task.
pub(crate) fn run(options: &TrackOptions) -> Result<Ending, Error> {
    match (options.model, &options.anchors) {
        (Model::Ranges, Some(anchors)) => ranges(&ranges::options(options, anchors)?),
        (_, Some(_)) => Err(Error::Needed {
            option: "--model ranges",
            reason: "--anchors says where ranges are measured from",
        }),
        _ => level::run(options, Instants::open(&options.table, &Kind::of(options))?),
    }
}

/// Runs the task `ranges`.
pub(crate) fn ranges(options: &RangesOptions) -> Result<Ending, Error> {
    let kind = Kind {
        by: options.table.by.clone(),
        ..Kind::default()
    };
    ranges::run(options, Instants::open(&options.table, &kind)?)
}
