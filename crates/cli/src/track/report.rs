//! Common output of both tasks: the first cell of a row, bands, a summary.

use super::rows::Instants;
use crate::error::Error;
use crate::output::Cell;
use crate::say::say;

/// Deviations to either side of a mean that hold 95 % of a normal law.
pub(super) const BAND: f64 = 1.96;

/// The first cell of a row: time or number.
pub(super) fn first_cell(instants: &Instants, time: String) -> Cell {
    if instants.has_time() {
        Cell::Text(time)
    } else {
        time.parse().map_or(Cell::Text(time), Cell::Whole)
    }
}

/// The name of the first cell.
pub(super) fn first_name(instants: &Instants) -> &'static str {
    if instants.has_time() { "time" } else { "row" }
}

/// Prints a summary: as JSON or as lines.
pub(super) fn summarise(summary: &impl serde::Serialize, lines: &[String], json: bool) -> Result<(), Error> {
    if json {
        say!("{}", serde_json::to_string(summary)?);
    } else {
        lines.iter().for_each(|line| say!("{line}"));
    }
    Ok(())
}
