//! Tables as instants: what was sampled when, from wide and from long tables.

use crate::error::{Outcome, refused};
use crate::seat::{Missing, Seat};
use crate::table::{Cells, Given, Origin};
use smallvec::SmallVec;

/// All samples of one time.
#[derive(Clone, Default)]
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
#[inline]
pub(crate) fn sample(number: usize, missing: Missing, cell: Option<f64>) -> Option<(usize, Option<f64>)> {
    let cell = cell.filter(|x| x.is_finite());
    (cell.is_some() || missing == Missing::Silence).then_some((number, cell))
}

/// The instants of a table, in its order.
pub(crate) enum Instants {
    /// One a row, made when it is asked for: of many rows they would take more memory than the table.
    Wide {
        seconds: Vec<f64>,
        columns: Vec<(Cells, Missing)>,
    },
    Long(Vec<Instant>),
}

impl Instants {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Wide { seconds, .. } => seconds.len(),
            Self::Long(instants) => instants.len(),
        }
    }

    /// Writes the instant of this number, which is below `len`.
    #[inline]
    pub(crate) fn read(&self, number: usize, instant: &mut Instant) {
        match self {
            Self::Wide { seconds, columns } => {
                (instant.seconds, instant.row) = (seconds[number], number);
                instant.samples.clear();
                for (sensor, (cells, missing)) in columns.iter().enumerate() {
                    instant.samples.extend(sample(sensor, *missing, cells[number]));
                }
            }
            Self::Long(instants) => instant.clone_from(&instants[number]),
        }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = Instant> {
        (0..self.len()).map(|number| {
            let mut instant = Instant::default();
            self.read(number, &mut instant);
            instant
        })
    }

    /// Numbers of their rows in the table.
    pub(crate) fn rows(&self) -> Vec<usize> {
        match self {
            Self::Wide { seconds, .. } => (0..seconds.len()).collect(),
            Self::Long(instants) => instants.iter().map(|instant| instant.row).collect(),
        }
    }
}

/// The instants of a table, in its order.
pub(crate) fn of(
    given: &Given,
    time: &str,
    long: Option<Long<'_>>,
    seats: &[Seat],
    origin: Option<Origin>,
) -> Outcome<(Instants, Option<Origin>)> {
    let times = given.times(time)?;
    let Some(origin) = origin.or_else(|| times.origin()) else {
        return Ok((Instants::Long(Vec::new()), None));
    };
    let seconds = times.since(origin)?;
    let instants = match long {
        None => {
            let columns = seats.iter().map(|seat| Ok((given.numbers(&seat.name)?, seat.missing)));
            Instants::Wide {
                seconds,
                columns: columns.collect::<Outcome<_>>()?,
            }
        }
        Some(Long { by, value }) => {
            let mut instants: Vec<Instant> = Vec::new();
            let (names, cells) = (given.texts(by)?, given.numbers(value)?);
            for (row, ((seconds, name), cell)) in seconds.into_iter().zip(names).zip(cells).enumerate() {
                let Some(seat) = seats.iter().position(|seat| seat.name == name) else {
                    let known: Vec<&str> = seats.iter().map(|seat| seat.name.as_str()).collect();
                    return refused("by", format!("'{name}' in row {row}"), format!("one of {}", known.join(", ")));
                };
                let sample = sample(seat, seats[seat].missing, cell);
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
            Instants::Long(instants)
        }
    };
    Ok((instants, Some(origin)))
}
