//! Tables that are packed in a single pass.

use crate::arguments::{BoundOptions, TableOptions};
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use std::path::Path;

/// Whether an output is written beside its place, so that it can be given up.
pub(crate) fn is_written_beside(path: &Path) -> bool {
    std::fs::metadata(path).map_or(true, |found| found.is_file())
}

/// The table, if it is a file of plain numbers in its first rows, and no bound needs the ranges of columns.
pub(crate) fn readable_once(options: &TableOptions, bounds: &BoundOptions) -> Result<Option<Table>, Error> {
    let is_candidate = is_regular(&options.file)
        && options.by.is_none()
        && options.dialect.said()?.skip_bad == 0
        && !bounds.bound.contains('%');
    if !is_candidate {
        return Ok(None);
    }
    let table = Table::open(options)?;
    Ok(table.is_plain().then_some(table))
}
