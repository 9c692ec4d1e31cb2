//! Tables as instants: what was sampled when, from wide and from long tables.

use crate::error::{Outcome, refused};
use crate::seat::{Missing, Seat};
use crate::table::{Given, Origin};
use smallvec::SmallVec;

/// All samples of one time.
pub(crate) struct Instant {
    pub(crate) seconds: f64,
    /// The first row of the table with this time.
    pub(crate) row: usize,
    /// Sensor and sample; `None` if a report was due and nothing arrived. Most instants have few: then nothing is allocated.
    pub(crate) samples: SmallVec<[(usize, Option<f64>); 2]>,
}

/// Where a long table has names and samples.
pub(crate) struct Long<'a> {
    pub(crate) by: &'a str,
    pub(crate) value: &'a str,
}

/// What a cell says of its sensor; nothing if the cell is missing (null, or not finite) and its sensor was not due.
pub(crate) fn sample(number: usize, seat: &Seat, cell: Option<f64>) -> Option<(usize, Option<f64>)> {
    let cell = cell.filter(|x| x.is_finite());
    (cell.is_some() || seat.missing == Missing::Silence).then_some((number, cell))
}

/// The instants of a table, in its order.
pub(crate) fn of(
    given: &Given,
    time: &str,
    long: Option<Long<'_>>,
    seats: &[Seat],
    origin: Option<Origin>,
) -> Outcome<(Vec<Instant>, Option<Origin>)> {
    let times = given.times(time)?;
    let Some(origin) = origin.or_else(|| times.origin()) else {
        return Ok((Vec::new(), None));
    };
    let seconds = times.since(origin)?;
    let mut instants: Vec<Instant> = Vec::new();
    match long {
        None => {
            let columns = seats
                .iter()
                .map(|seat| given.numbers(&seat.name))
                .collect::<Outcome<Vec<_>>>()?;
            for (row, seconds) in seconds.into_iter().enumerate() {
                let cells = columns.iter().zip(seats).enumerate();
                let samples = cells.filter_map(|(number, (cells, seat))| sample(number, seat, cells[row]));
                instants.push(Instant {
                    seconds,
                    row,
                    samples: samples.collect(),
                });
            }
        }
        Some(Long { by, value }) => {
            let (names, cells) = (given.texts(by)?, given.numbers(value)?);
            for (row, ((seconds, name), cell)) in seconds.into_iter().zip(names).zip(cells).enumerate() {
                let Some(seat) = seats.iter().position(|seat| seat.name == name) else {
                    let known: Vec<&str> = seats.iter().map(|seat| seat.name.as_str()).collect();
                    return refused("by", format!("'{name}' in row {row}"), format!("one of {}", known.join(", ")));
                };
                let sample = sample(seat, &seats[seat], cell);
                match instants.last_mut() {
                    // A second sample of a sensor at one time is an instant of its own.
                    Some(last) if last.seconds == seconds && last.samples.iter().all(|(other, _)| *other != seat) => {
                        last.samples.extend(sample);
                    }
                    _ => instants.push(Instant {
                        seconds,
                        row,
                        samples: sample.into_iter().collect(),
                    }),
                }
            }
        }
    }
    Ok((instants, Some(origin)))
}
