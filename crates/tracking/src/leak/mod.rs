//! In which room a substance escapes, from readings of a few bits at any times.

pub(crate) mod rooms;

use crate::error::Error;
use crate::rows::instant::Instant;
use crate::text::short;
use fewbits_diffusion::{LeakBelief, Plan, Transport};
use rooms::Rooms;
use serde::Serialize;

/// Deviations to either side of a mean that hold 95 % of a normal law.
const BAND: f64 = 1.96;
/// The probability with which the written area holds the leak.
const AREA: f64 = 0.9;
/// From so many reports on, zeros and ones are told to be bits.
const BITS: u64 = 6;
/// Below this misfit rooms are not to be trusted.
const MISFIT: f64 = 1e-3;
/// What is in no room.
const ELSEWHERE: &str = "elsewhere";

/// What was found of a leak over all rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LeakSummary {
    /// Number of rows.
    pub rows: u64,
    /// Number of readings.
    pub readings: u64,
    /// Rows, or single reports, that say the same again and were dropped.
    pub copies: u64,
    /// Probability of each room, the likeliest first.
    pub rooms: Vec<(String, f64)>,
    /// Square metres of the area that holds the leak with a probability of 90 %.
    pub area: f64,
    /// Share of cases in which readings are at least as surprising.
    pub misfit: f64,
    /// Sensors without a reading.
    pub silent: Vec<String>,
    /// What the readings suggest that the rooms do not say, a sentence each.
    pub hints: Vec<String>,
    /// The summary as sentences, with the plan.
    #[serde(skip)]
    pub lines: Vec<String>,
}

/// What is known of a leak. Bands hold 95 %: estimate, lower and upper end.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LeakEstimate {
    /// Probability of each room, the likeliest first.
    pub rooms: Vec<(String, f64)>,
    /// The likeliest place in metres.
    pub place: [f64; 3],
    /// Square metres of the area that holds the leak with a probability of 90 %.
    pub area: f64,
    /// Columns and lines of the cells of that area.
    pub cells: Vec<[usize; 3]>,
    /// Rate with its band.
    pub rate: [f64; 3],
    /// Start in seconds after the first row, with its band.
    pub start: [f64; 3],
    /// Share of cases in which readings are at least as surprising.
    pub misfit: f64,
}

fn estimate(belief: &LeakBelief, plan: &Plan, transport: &Transport) -> Result<LeakEstimate, fewbits_diffusion::Error> {
    let (domain, area) = (transport.domain(), belief.area(AREA)?);
    let (grid, volumes) = (domain.grid(), domain.volumes());
    let band = |(mean, deviation): (f64, f64)| [mean, mean - BAND * deviation, mean + BAND * deviation];
    Ok(LeakEstimate {
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

/// A leak, reading by reading.
pub struct LeakTracker {
    rooms: Rooms,
    plan: Plan,
    belief: LeakBelief,
    transport: Transport,
    /// Of each sensor of the rows, its place among those of the rooms.
    places: Vec<usize>,
    rows: u64,
    /// Number of readings of each sensor of the rooms, and how often it reported 0 and 1.
    heard: Vec<u64>,
    bits: Vec<[u64; 2]>,
}

fn refused(source: fewbits_diffusion::Error) -> Error {
    Error::Refused {
        what: "the belief is refused",
        source: source.into(),
    }
}

impl LeakTracker {
    /// A tracker for rows with sensors of these names, the last of which is `last` seconds after the first.
    ///
    /// # Errors
    /// If the rooms are refused, or have no sensor of a name.
    pub fn new(rooms: &Rooms, names: &[String], last: f64) -> Result<Self, Error> {
        let plan = rooms.check()?;
        let known: Vec<&str> = rooms.names().collect();
        let place = |name: &String| {
            let place = known.iter().position(|known| known == name);
            place.ok_or_else(|| Error::Unknown { name: name.clone() })
        };
        let places = names.iter().map(place).collect::<Result<_, _>>()?;
        let (belief, transport) = rooms.belief(&plan, last)?;
        Ok(Self {
            rooms: rooms.clone(),
            plan,
            belief,
            transport,
            places,
            rows: 0,
            heard: vec![0; known.len()],
            bits: vec![[0; 2]; known.len()],
        })
    }

    /// Names of the rooms, and last of what is in none.
    pub fn rooms(&self) -> Vec<&str> {
        self.plan.rooms().into_iter().chain([ELSEWHERE]).collect()
    }

    /// Number of readings so far.
    pub fn readings(&self) -> u64 {
        self.heard.iter().sum()
    }

    /// Takes in the readings of an instant.
    ///
    /// # Errors
    /// If a report is of no sensor, or is none that its sensor sends: the tracker is then as it was. If a reading is refused by the belief.
    pub fn step(&mut self, instant: &Instant) -> Result<(), Error> {
        let mut readings = Vec::with_capacity(instant.reports.len());
        for (i, (column, cell)) in instant.reports.iter().enumerate() {
            let Some(sensor) = self.places.get(*column).copied() else {
                let problem = format!("a report of sensor {column}: there are {}, counted from 0", self.places.len());
                let row = instant.row;
                return Err(Error::Content { row, problem });
            };
            if let Some(cell) = cell {
                let qualifier = instant.qualifiers.get(i).copied().unwrap_or_default();
                let reading = self.rooms.reading(sensor, *cell, qualifier);
                let (reading, deviation) = reading.map_err(|fault| Error::row(instant.row)(fault.into()))?;
                readings.push((sensor, *cell, reading, deviation));
            }
        }
        for (sensor, cell, reading, deviation) in readings {
            let observed = self.belief.observe(sensor, instant.seconds, &reading, deviation);
            observed.map_err(|fault| Error::row(instant.row)(Box::new(fault)))?;
            self.heard[sensor] += 1;
            if cell == 0.0 || cell == 1.0 {
                self.bits[sensor][usize::from(cell == 1.0)] += 1;
            }
        }
        self.rows += 1;
        Ok(())
    }

    /// What is known of the leak.
    ///
    /// # Errors
    /// If the readings leave no place.
    pub fn estimate(&self) -> Result<LeakEstimate, Error> {
        estimate(&self.belief, &self.plan, &self.transport).map_err(refused)
    }

    /// What was found over all rows. `copies`: number of rows that were dropped before, [`Instants::copies`](crate::Instants::copies).
    ///
    /// # Errors
    /// As [`estimate`](Self::estimate).
    pub fn finish(self, copies: u64) -> Result<LeakSummary, Error> {
        let found = self.estimate()?;
        let known: Vec<&str> = self.rooms.names().collect();
        let is_bits = |sensor: &usize| {
            let ([zeros, ones], heard) = (self.bits[*sensor], self.heard[*sensor]);
            self.rooms.sends_values(*sensor) && zeros.min(ones) > 0 && zeros + ones == heard && heard >= BITS
        };
        let hint = |sensor: usize| {
            let name = known[sensor];
            format!(
                "{name} reports 0 and 1 only: if it says whether a threshold is reached, state its `thresholds`; without them the rooms are wrong"
            )
        };
        let silent = known.iter().zip(&self.heard).filter(|(_, readings)| **readings == 0);
        let mut summary = LeakSummary {
            rows: self.rows,
            readings: self.readings(),
            copies,
            silent: silent.map(|(name, _)| (*name).to_owned()).collect(),
            hints: (0..known.len()).filter(is_bits).map(hint).collect(),
            area: found.area,
            misfit: found.misfit,
            rooms: found.rooms.clone(),
            lines: Vec::new(),
        };
        summary.lines = page(&summary, &found, &self.rooms);
        Ok(summary)
    }
}

fn page(summary: &LeakSummary, found: &LeakEstimate, rooms: &Rooms) -> Vec<String> {
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
