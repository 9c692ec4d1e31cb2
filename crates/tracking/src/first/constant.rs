//! Columns that have one value while others vary: a sensor that is dead from the start, a set point, a number of the device. They measure no level.
//! Nor do columns of 0 and 1, as whether a pump runs, while others are elsewhere.

use crate::first::values::values_of;
use crate::rows::instant::Instant;
use crate::text;
use fewbits_table::names::as_argument;

/// Values that are all equal, at least, and different values of another column.
const FEWEST: usize = 30;
const DIFFERENT: usize = 10;
/// A level near 0 and 1.
const NEAR: std::ops::RangeInclusive<f64> = -0.5..=1.5;

/// What each column repeats, if it does. A column counts from its first other value on.
#[derive(Debug)]
pub(crate) struct Constants {
    of: Vec<Option<f64>>,
    /// The same, of the first rows.
    at_first: Vec<Option<f64>>,
    /// Columns of 0 and 1.
    states: Vec<bool>,
}

impl Constants {
    /// Of the first rows.
    pub(crate) fn begin(first: &[Instant], sensors: usize) -> Self {
        let columns: Vec<Vec<f64>> = (0..sensors).map(|sensor| values_of(first, sensor)).collect();
        let different = |column: &Vec<f64>| {
            let mut sorted = column.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.dedup();
            sorted.len()
        };
        let counts: Vec<usize> = columns.iter().map(different).collect();
        let vary = counts.iter().any(|count| *count >= DIFFERENT);
        let of = |(column, count): (&Vec<f64>, &usize)| {
            let is_constant = vary && *count == 1 && column.len() >= FEWEST;
            column.first().copied().filter(|_| is_constant)
        };
        let of: Vec<Option<f64>> = columns.iter().zip(&counts).map(of).collect();
        let is_bit = |value: &&f64| **value == 0.0 || **value == 1.0;
        // A sensor of a level near 0 and 1 may round to them.
        let is_far = |column: &Vec<f64>| {
            let near = column.iter().filter(|value| NEAR.contains(value)).count();
            2 * near < column.len()
        };
        let is_state = |(column, count): (&Vec<f64>, &usize)| {
            let is_bits = *count == 2 && column.len() >= FEWEST && column.iter().filter(is_bit).count() == column.len();
            let mut others = columns.iter().zip(&counts).filter(|(_, count)| **count >= DIFFERENT);
            is_bits && vary && others.all(|(other, _)| is_far(other))
        };
        Self {
            states: columns.iter().zip(&counts).map(is_state).collect(),
            at_first: of.clone(),
            of,
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.of.iter().all(Option::is_none) && !self.states.contains(&true)
    }

    /// Whether a cell repeats the value of its column, or is a state.
    pub(crate) fn repeats(&mut self, sensor: usize, cell: Option<f64>) -> bool {
        if self.states.get(sensor) == Some(&true) && cell.is_none_or(|cell| cell == 0.0 || cell == 1.0) {
            return true;
        }
        let Some(value) = self.of.get_mut(sensor).filter(|value| value.is_some()) else {
            return false;
        };
        if cell.is_some_and(|cell| Some(cell) != *value) {
            *value = None;
        }
        value.is_some() && cell.is_some()
    }

    /// A line for each such column.
    pub(crate) fn hints(&self, names: &[String]) -> impl Iterator<Item = String> {
        let states = self.states.iter().zip(names).filter(|(is_state, _)| **is_state);
        let states = states.map(|(_, name)| {
            let name = text::name(name);
            format!(
                "{name} is 0 or 1, while others are elsewhere: it is taken for a state and left out, as --without {} does; --noise, --change and --prior \
                 together keep it",
                as_argument([&name])
            )
        });
        let columns = self.at_first.iter().zip(&self.of).zip(names);
        states.chain(columns.filter_map(|((at_first, now), name)| {
            let (value, name) = ((*at_first)?, text::name(name));
            let until = if now.is_some() {
                "in all rows"
            } else {
                "in all of the first rows"
            };
            Some(format!(
                "{name} is {value} {until}, while others vary: it is left out until it changes, as --without {} does; --noise, --change and --prior \
                 together keep it",
                as_argument([&name])
            ))
        }))
    }
}
