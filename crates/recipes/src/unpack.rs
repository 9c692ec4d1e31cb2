//! Rows out of a recording, and their cells as text.

use crate::error::{Error, Failure};
use crate::source::{Watch, report};
use crate::{times, words};
use fewbits_record::{Block, Column, Integers, Schema, TimeBase};

/// The rows and columns of a recording that are wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection {
    /// The first and the last tick.
    pub ticks: (i64, i64),
    /// Indices of the columns.
    pub columns: Vec<usize>,
    /// Their names.
    pub names: Vec<String>,
}

impl Selection {
    /// All rows and columns.
    pub fn all(schema: &Schema) -> Self {
        let names = schema.columns().iter().map(|column| column.name().to_owned());
        Self {
            ticks: (i64::MIN, i64::MAX),
            columns: (0..schema.columns().len()).collect(),
            names: names.collect(),
        }
    }

    /// All rows of these columns; of all columns if `names` is empty.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn new(schema: &Schema, names: &[String]) -> Result<Self, fewbits_record::Error> {
        if names.is_empty() {
            return Ok(Self::all(schema));
        }
        Ok(Self {
            columns: names
                .iter()
                .map(|name| schema.position(name))
                .collect::<Result<_, _>>()?,
            names: names.to_vec(),
            ..Self::all(schema)
        })
    }
}

/// Takes the tick and the cells of a row.
pub type Row<'a> = dyn FnMut(i64, &[Option<f64>]) -> Result<(), Failure> + 'a;

/// Gives the selected rows of blocks to `row`: tick and cells. A damaged block goes to `damaged`, and the blocks behind it are read.
/// Returns the number of rows.
///
/// # Errors
/// If the recording cannot be read, `row` fails, or `watch` breaks; it is called after each block.
pub fn rows(
    blocks: impl Iterator<Item = Result<Block, fewbits_record::Error>>,
    selection: &Selection,
    row: &mut Row<'_>,
    damaged: &mut dyn FnMut(&fewbits_record::Error),
    watch: &mut Watch<'_>,
) -> Result<u64, Error> {
    let (mut count, mut values) = (0, Vec::with_capacity(selection.columns.len()));
    for block in blocks {
        let block = match block {
            Ok(block) => block,
            Err(error @ fewbits_record::Error::Block { .. }) => {
                damaged(&error);
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        for (i, tick) in block.ticks.iter().enumerate() {
            if *tick < selection.ticks.0 || *tick > selection.ticks.1 {
                continue;
            }
            values.clear();
            values.extend(selection.columns.iter().map(|column| block.columns[*column][i]));
            row(*tick, &values).map_err(Error::Source)?;
            count += 1;
        }
        report(watch, count)?;
    }
    Ok(count)
}

/// A cell of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A word, or a time.
    Text(String),
    /// The number of a row, or a whole number of 64 bits.
    Whole(i64),
    /// A number; `None` is a gap.
    Number(Option<f64>),
}

impl Cell {
    /// The cell as text: the shortest that reads back as the same number; empty for a gap.
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Whole(number) => number.to_string(),
            Self::Number(None) => String::new(),
            Self::Number(Some(value)) if value.is_nan() => "NaN".to_owned(),
            // A whole number beyond 53 bits is the double of all its digits; fewer of them name another whole number.
            Self::Number(Some(value)) if (1e16..9e18).contains(&value.abs()) => (*value as i64).to_string(),
            Self::Number(Some(value)) if *value != 0.0 && (value.abs() < 1e-5 || value.abs() >= 1e16) => {
                format!("{value:e}")
            }
            Self::Number(Some(value)) => format!("{value}"),
        }
    }
}

/// Cells of rows of a recording.
#[derive(Debug, Clone)]
pub struct Cells {
    time: TimeBase,
    is_numbered: bool,
    meanings: Vec<Meaning>,
    names: Vec<String>,
}

/// What the numbers of a column stand for.
#[derive(Debug, Clone)]
enum Meaning {
    Themselves,
    Words(Vec<String>),
    Integers(Integers),
}

impl Meaning {
    fn of(column: &Column) -> Self {
        match (column.integers(), words::of(column.unit())) {
            (Some(integers), _) => Self::Integers(integers),
            (None, Some(words)) => Self::Words(words),
            (None, None) => Self::Themselves,
        }
    }

    fn cell(&self, value: Option<f64>) -> Cell {
        match (value, self) {
            (Some(code), Self::Integers(integers)) => Cell::Whole(integers.number(code)),
            (Some(index), Self::Words(words)) if index.fract() == 0.0 && index >= 0.0 => {
                let word = words.get(index as usize).cloned();
                word.map_or(Cell::Number(value), Cell::Text)
            }
            _ => Cell::Number(value),
        }
    }
}

/// A number of a column as text, as rows have it.
pub fn shown(column: &Column, value: f64) -> String {
    Meaning::of(column).cell(Some(value)).text()
}

impl Cells {
    /// Cells of these columns. `is_numbered`: whether rows of a recording without times have their number.
    pub fn new(schema: &Schema, names: &[String], is_numbered: bool) -> Self {
        let meaning = |name: &String| {
            let column = schema.position(name).map(|i| &schema.columns()[i]);
            column.map_or(Meaning::Themselves, Meaning::of)
        };
        let first = match schema.time() {
            TimeBase::Numbered => is_numbered.then_some("row"),
            _ => Some(schema.time_name()),
        };
        Self {
            time: schema.time(),
            is_numbered,
            meanings: names.iter().map(meaning).collect(),
            names: first
                .into_iter()
                .map(str::to_owned)
                .chain(names.iter().cloned())
                .collect(),
        }
    }

    /// Names of the cells: that of the time or the number of the row, if there is one, and those of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The cells of a row.
    pub fn row<'a>(&'a self, tick: i64, values: &'a [Option<f64>]) -> impl Iterator<Item = Cell> + 'a {
        let first = match self.time {
            TimeBase::Numbered => self.is_numbered.then_some(Cell::Whole(tick)),
            time => Some(Cell::Text(times::shown(tick, time))),
        };
        let cells = values.iter().zip(&self.meanings);
        first
            .into_iter()
            .chain(cells.map(|(value, meaning)| meaning.cell(*value)))
    }
}
