//! The task `leak`: in which room a substance escapes, from readings of a few bits at any times.

use super::columns::Kind;
use super::leak_rooms::Rooms;
use super::report::{BAND, first_cell, first_name, summarise};
use super::rows;
use crate::Ending;
use crate::arguments::LeakOptions;
use crate::error::Error;
use crate::numbers::short;
use crate::output::{Cell, Shape, Sheet};
use fewbits_diffusion::{LeakBelief, Plan, Transport};
use serde::Serialize;

/// The probability with which the written area holds the leak.
const AREA: f64 = 0.9;
/// From so many reports on, zeros and ones are told to be bits.
const BITS: u64 = 6;
/// Below this misfit rooms are not to be trusted.
const MISFIT: f64 = 1e-3;

#[derive(Serialize)]
struct Summary {
    rows: u64,
    readings: u64,
    /// Rows, or single reports, that say the same again and were dropped.
    copies: u64,
    /// Probability of each room, the likeliest first.
    rooms: Vec<(String, f64)>,
    /// Square metres of the area that holds the leak with a probability of 90 %.
    area: f64,
    misfit: f64,
    /// Sensors without a reading.
    silent: Vec<String>,
    /// What the readings suggest that the file of rooms does not say.
    hints: Vec<String>,
}

/// What the belief says after a row.
struct Estimate {
    rooms: Vec<(String, f64)>,
    place: [f64; 3],
    area: f64,
    /// Columns and lines of the cells of the area.
    cells: Vec<[usize; 3]>,
    /// Estimate and band.
    rate: [f64; 3],
    start: [f64; 3],
    misfit: f64,
}

fn estimate(belief: &LeakBelief, plan: &Plan, transport: &Transport) -> Result<Estimate, fewbits_diffusion::Error> {
    let (domain, area) = (transport.domain(), belief.area(AREA)?);
    let (grid, volumes) = (domain.grid(), domain.volumes());
    let band = |(mean, deviation): (f64, f64)| [mean, mean - BAND * deviation, mean + BAND * deviation];
    Ok(Estimate {
        rooms: belief.rooms(plan)?,
        // The area begins with the likeliest cell.
        place: grid.centre(domain.free()[area[0]]),
        area: area.iter().map(|cell| volumes[*cell]).sum(),
        cells: area.iter().map(|cell| grid.place(domain.free()[*cell])).collect(),
        rate: band(belief.log_rate()).map(f64::exp),
        start: band(belief.start()),
        misfit: belief.misfit(),
    })
}

/// Names of the columns behind the first.
fn columns(plan: &Plan) -> Vec<String> {
    let rooms = plan
        .rooms()
        .into_iter()
        .chain(["elsewhere"])
        .map(|room| format!("p_{room}"));
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

fn cells(found: &Estimate, plan: &Plan, readings: u64) -> Vec<Cell> {
    let rooms = plan.rooms().into_iter().chain(["elsewhere"]);
    let probability = |room: &str| found.rooms.iter().find(|(known, _)| known == room).map(|(_, p)| *p);
    let rest = [found.place[0], found.place[1], found.area]
        .into_iter()
        .chain(found.rate)
        .chain(found.start);
    let numbers = rooms.map(probability).chain(rest.chain([found.misfit]).map(Some));
    let name = found.rooms.first().map_or_else(String::new, |(room, _)| room.clone());
    let first = std::iter::once(Cell::Text(name));
    first
        .chain(numbers.map(Cell::Number))
        .chain([Cell::Whole(readings as i64)])
        .collect()
}

/// Runs the task.
pub(super) fn run(options: &LeakOptions) -> Result<Ending, Error> {
    let rooms = Rooms::read(&options.rooms)?;
    let file = options.rooms.display().to_string();
    let plan = Plan::parse(&rooms.plan).map_err(|fault| Error::content(&file, fault))?;
    let kind = Kind {
        by: options.table.by.clone(),
        ..Kind::default()
    };
    let mut instants = rows::open(&options.table, &kind, None)?;
    let failed = Error::tracking(instants.source().file());
    let mut rows = Vec::new();
    while let Some(instant) = instants.next().map_err(&failed)? {
        rows.push(instant);
    }
    let known: Vec<&str> = rooms.names().collect();
    let place = |name: &String| {
        known.iter().position(|known| known == name).ok_or_else(|| {
            let names = known.join(", ");
            let mend = "add it there, choose columns with --columns, or name the column of sensors with --by";
            Error::content(
                instants.source().file(),
                format_args!("`{name}` is no sensor of {file}, which has {names}: {mend}"),
            )
        })
    };
    let places: Vec<usize> = instants.names().iter().map(place).collect::<Result<_, _>>()?;
    let (mut belief, transport) = rooms.belief(&plan, rows.last().map_or(0.0, |row| row.seconds))?;
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(columns(&plan))
        .collect();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?;
    let refused = Error::refused("the belief is refused");
    let (mut heard, count) = (vec![0_u64; known.len()], rows.len());
    // How often each sensor reported 0 and 1.
    let mut bits = vec![[0_u64; 2]; known.len()];
    for (number, row) in rows.into_iter().enumerate() {
        for ((column, cell), qualifier) in row.reports.iter().zip(&row.qualifiers) {
            let (Some(cell), sensor) = (cell, places[*column]) else {
                continue;
            };
            let failed = |source| Error::Row {
                file: instants.source().file().to_owned(),
                row: row.row,
                source,
            };
            let (reading, deviation) = rooms
                .reading(sensor, *cell, *qualifier)
                .map_err(|fault| failed(fault.into()))?;
            let observed = belief.observe(sensor, row.seconds, &reading, deviation);
            observed.map_err(|fault| failed(Box::new(fault)))?;
            heard[sensor] += 1;
            if *cell == 0.0 || *cell == 1.0 {
                bits[sensor][usize::from(*cell == 1.0)] += 1;
            }
        }
        if !options.last || number + 1 == count {
            let found = estimate(&belief, &plan, &transport).map_err(&refused)?;
            let first = first_cell(&instants, row.time);
            sheet.write(std::iter::once(first).chain(cells(&found, &plan, heard.iter().sum())))?;
        }
    }
    sheet.finish()?;
    let found = estimate(&belief, &plan, &transport).map_err(&refused)?;
    let is_bits = |sensor: &usize| {
        let [zeros, ones] = bits[*sensor];
        rooms.sends_values(*sensor) && zeros.min(ones) > 0 && zeros + ones == heard[*sensor] && heard[*sensor] >= BITS
    };
    let hint = |sensor: usize| {
        let name = known[sensor];
        format!(
            "{name} reports 0 and 1 only: if it says whether a threshold is reached, state its `thresholds`; without them the rooms are wrong"
        )
    };
    let silent = known.iter().zip(&heard).filter(|(_, readings)| **readings == 0);
    let summary = Summary {
        rows: count as u64,
        readings: heard.iter().sum(),
        copies: instants.copies(),
        silent: silent.map(|(name, _)| (*name).to_owned()).collect(),
        hints: (0..known.len()).filter(is_bits).map(hint).collect(),
        area: found.area,
        misfit: found.misfit,
        rooms: found.rooms.clone(),
    };
    summarise(&summary, &page(&summary, &found, &rooms), options.json)?;
    Ok(Ending::Good)
}

fn page(summary: &Summary, found: &Estimate, rooms: &Rooms) -> Vec<String> {
    let mut lines = vec![format!("{} rows, {} readings", summary.rows, summary.readings)];
    if summary.copies > 0 {
        lines.push(format!("{} copies of rows were dropped", summary.copies));
    }
    if !summary.silent.is_empty() {
        lines.push(format!("no reading of {}", summary.silent.join(", ")));
    }
    lines.extend(summary.hints.iter().cloned());
    let misfit = summary.misfit;
    if misfit < MISFIT {
        lines.push(format!(
            "misfit {misfit:.1e}: one leak in these rooms does not explain the readings. Do not trust the rooms: walls, air, a sensor, its noise or the \
             number of leaks are others"
        ));
    } else {
        lines.push(format!(
            "misfit {misfit:.3}: readings at least as surprising as these are expected in this share of cases"
        ));
    }
    let shown = |(name, p): &(String, f64)| format!("{name} {p:.3}");
    let all: Vec<String> = summary.rooms.iter().filter(|(_, p)| *p >= 5e-4).map(shown).collect();
    lines.push(format!("the leak is in: {}", all.join(", ")));
    let [rate, start] = [found.rate, found.start].map(|band| band.map(short));
    lines.push(format!("rate {} ({} to {}) per second", rate[0], rate[1], rate[2]));
    lines.push(format!("it began {} s ({} to {}) after the first row", start[0], start[1], start[2]));
    lines.push(format!("area that holds it with 90 %, {} m^2:", short(found.area)));
    lines.extend(
        rooms
            .drawn(found.cells.iter().copied())
            .iter()
            .map(|line| format!("  {line}")),
    );
    lines
}
