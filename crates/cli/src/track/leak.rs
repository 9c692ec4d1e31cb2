//! The task `leak`: in which room a substance escapes; its file of rooms, and the sheet.

use super::columns::Kind;
use super::report::{first_cell, first_name, summarise};
use super::rows;
use crate::Ending;
use crate::arguments::LeakOptions;
use crate::error::Error;
use crate::output::{Cell, Shape, Sheet};
use fewbits_tracking::{Error as Refusal, LeakEstimate, LeakTracker, Rooms};
use std::path::Path;

/// Names of the columns behind the first.
fn columns(rooms: &[&str]) -> Vec<String> {
    let rooms = rooms.iter().map(|room| format!("p_{room}"));
    let rest = [
        "x",
        "y",
        "area",
        "rate",
        "rate_low",
        "rate_high",
        "start",
        "start_low",
        "start_high",
        "misfit",
        "readings",
    ];
    std::iter::once("room".to_owned())
        .chain(rooms)
        .chain(rest.map(str::to_owned))
        .collect()
}

fn cells(found: &LeakEstimate, rooms: &[&str], readings: u64) -> Vec<Cell> {
    let probability = |room: &str| found.rooms.iter().find(|(known, _)| known == room).map(|(_, p)| *p);
    let rest = [found.place[0], found.place[1], found.area]
        .into_iter()
        .chain(found.rate)
        .chain(found.start);
    let numbers = rooms
        .iter()
        .map(|room| probability(room))
        .chain(rest.chain([found.misfit]).map(Some));
    let name = found.rooms.first().map_or_else(String::new, |(room, _)| room.clone());
    let first = std::iter::once(Cell::Text(name));
    first
        .chain(numbers.map(Cell::Number))
        .chain([Cell::Whole(readings as i64)])
        .collect()
}

/// Reads the file of rooms.
fn read(path: &Path) -> Result<Rooms, Error> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(Error::io(&file, "read"))?;
    let rooms: Rooms = toml::from_str(&text).map_err(|fault| Error::content(&file, fault))?;
    rooms.check().map_err(|fault| Error::content(&file, fault))?;
    Ok(rooms)
}

/// Runs the task.
pub(super) fn run(options: &LeakOptions) -> Result<Ending, Error> {
    let rooms = read(&options.rooms)?;
    let kind = Kind {
        by: options.table.by.clone(),
        ..Kind::default()
    };
    let mut instants = rows::open(&options.table, &kind, None)?;
    let table = instants.source().file().to_owned();
    let failed = Error::tracking(&table);
    let mut rows = Vec::new();
    while let Some(instant) = instants.next().map_err(&failed)? {
        rows.push(instant);
    }
    let refused = |fault| match fault {
        Refusal::Unknown { name } => {
            let (file, known) = (options.rooms.display(), rooms.sensor.iter().map(|sensor| sensor.name.as_str()));
            let names = known.collect::<Vec<_>>().join(", ");
            let mend = "add it there, choose columns with --columns, or name the column of sensors with --by";
            Error::content(&table, format_args!("`{name}` is no sensor of {file}, which has {names}: {mend}"))
        }
        Refusal::Rooms { problem } => Error::content("--rooms", problem),
        fault => failed(fault),
    };
    let last = rows.last().map_or(0.0, |row| row.seconds);
    let mut tracker = LeakTracker::new(&rooms, instants.names(), last).map_err(refused)?;
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(columns(&tracker.rooms()))
        .collect();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?;
    let count = rows.len();
    for (number, row) in rows.into_iter().enumerate() {
        tracker.step(&row).map_err(&failed)?;
        if !options.last || number + 1 == count {
            let found = tracker.estimate().map_err(&failed)?;
            let first = first_cell(&instants, row.time);
            sheet.write(std::iter::once(first).chain(cells(&found, &tracker.rooms(), tracker.readings())))?;
        }
    }
    sheet.finish()?;
    let summary = tracker.finish(instants.copies()).map_err(&failed)?;
    summarise(&summary, &summary.lines, options.json)?;
    Ok(Ending::Good)
}
