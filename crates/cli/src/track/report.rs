//! Common output of both tasks: the first cell of a row, bands, a summary.

use super::rows::Instants;
use crate::error::Error;
use crate::output::Cell;
use crate::say::{self, say};
use crate::track_options::Transform;
use fewbits_tracking::LevelRow;

/// Deviations to either side of a mean that hold 95 % of a normal law.
pub(super) const BAND: f64 = 1.96;

/// The first cell of a row: time or number.
pub(super) fn first_cell(instants: &Instants, time: String) -> Cell {
    if instants.source().has_time() {
        Cell::Text(time)
    } else {
        time.parse().map_or(Cell::Text(time), Cell::Whole)
    }
}

/// The name of the first cell.
pub(super) fn first_name(instants: &Instants) -> &'static str {
    if instants.source().has_time() { "time" } else { "row" }
}

/// Prints a summary: as JSON or as lines.
pub(super) fn summarise(summary: &impl serde::Serialize, lines: &[String], json: bool) -> Result<(), Error> {
    if json {
        say::data(&serde_json::to_string(summary)?);
    } else {
        lines.iter().for_each(|line| say!("{line}"));
    }
    Ok(())
}

/// The value of which a number is the transform.
pub(super) fn value_of(transform: Option<Transform>, number: f64) -> f64 {
    transform.map_or(number, |transform| fewbits_tracking::Transform::from(transform).inverse(number))
}

/// How a level is written: of which it is a function; so many coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    pub(super) transform: Option<Transform>,
    pub(super) coordinates: usize,
}

/// The cells of a row of a level. `estimate`: an angle within one period.
pub(super) fn cells(shown: Shown, first: Cell, estimate: &[(f64, f64)], row: &LevelRow, events: String) -> Vec<Cell> {
    let estimates = estimate.iter().take(shown.coordinates).flat_map(|(mean, deviation)| {
        let value = |number| Cell::Number(Some(value_of(shown.transform, number)));
        [*mean, mean - BAND * deviation, mean + BAND * deviation].map(value)
    });
    let last = [
        Cell::Whole(row.reports as i64),
        Cell::Whole(row.rejected as i64),
        Cell::Whole(row.bits as i64),
        Cell::Whole(row.used as i64),
        Cell::Number(Some(row.noise_scale)),
        Cell::Text(events),
    ];
    std::iter::once(first).chain(estimates).chain(last).collect()
}

/// The events of a row, as its cell.
pub(super) fn events(row: &LevelRow, names: &[String]) -> String {
    let words: Vec<String> = row
        .events
        .iter()
        .map(|(event, sensor)| match sensor {
            Some(sensor) => format!("{} {event}", names[*sensor]),
            None => (*event).to_owned(),
        })
        .collect();
    words.join("; ")
}
