//! Common output of both tasks: the first cell of a row, bands, a summary.

use super::estimator::Step;
use super::rows::Instants;
use super::transform::Transform;
use crate::error::Error;
use crate::output::Cell;
use crate::say::{self, say};

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
        say::data(&serde_json::to_string(summary)?);
    } else {
        lines.iter().for_each(|line| say!("{line}"));
    }
    Ok(())
}

/// An angle: its period, and the end of the period within which it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Circle {
    pub(super) period: f64,
    pub(super) low: f64,
}

/// How a level is written: of a circle, if it is an angle; of which it is a function; so many coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    pub(super) circle: Option<Circle>,
    pub(super) transform: Option<Transform>,
    pub(super) coordinates: usize,
}

/// The cells of a row of a level.
pub(super) fn cells(shown: Shown, first: Cell, estimate: &[(f64, f64)], step: &Step, events: String) -> Vec<Cell> {
    // An angle is written within one period.
    let turns = match (shown.circle, estimate.first()) {
        (Some(circle), Some((level, _))) => circle.period * ((level - circle.low) / circle.period).floor(),
        _ => 0.0,
    };
    let estimates = estimate
        .iter()
        .take(shown.coordinates)
        .enumerate()
        .flat_map(|(i, (mean, deviation))| {
            let mean = if i == 0 { mean - turns } else { *mean };
            let value = |number| shown.transform.map_or(number, |transform| transform.inverse(number));
            [mean, mean - BAND * deviation, mean + BAND * deviation].map(|number| Cell::Number(Some(value(number))))
        });
    let last = [
        Cell::Whole(step.reports as i64),
        Cell::Whole(step.rejected as i64),
        Cell::Whole(step.bits as i64),
        Cell::Whole(step.used as i64),
        Cell::Number(Some(step.noise_scale)),
        Cell::Text(events),
    ];
    std::iter::once(first).chain(estimates).chain(last).collect()
}

/// The events of a row, as its cell.
pub(super) fn events(step: &Step, names: &[String]) -> String {
    let words: Vec<String> = step
        .events
        .iter()
        .map(|(event, sensor)| match sensor {
            Some(sensor) => format!("{} {event}", names[*sensor]),
            None => (*event).to_owned(),
        })
        .collect();
    words.join("; ")
}
