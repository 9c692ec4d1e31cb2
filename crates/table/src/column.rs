//! Columns of a table, the kinds of their cells, and batches of cells.

use crate::error::Place;
use crate::time::Time;

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Kind {
    /// Numbers that doubles hold.
    Number,
    /// Whole numbers of 64 bits, at least one of which is no double.
    Integer,
    /// `true`/`false`, `on`/`off`, `yes`/`no`.
    Boolean,
    /// Words of which there are few.
    Words,
    /// Times.
    Time,
    /// Text that is none of these. Such a column cannot be read, only left out.
    Text,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Number => "number",
            Self::Integer => "integer",
            Self::Boolean => "boolean",
            Self::Words => "words",
            Self::Time => "time",
            Self::Text => "text",
        })
    }
}

/// Largest number of words of a column of [`Kind::Words`].
pub const MAX_WORDS: usize = 256;

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Column {
    /// Its name, which no other column has.
    pub name: String,
    /// Its name as the file has it.
    pub own_name: String,
    /// Its unit; empty if the table states none.
    pub unit: String,
    /// The kind of its cells.
    pub kind: Kind,
}

/// Cells of a column; `None` is a gap.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Cells {
    /// Cells of [`Kind::Number`].
    Numbers(Vec<Option<f64>>),
    /// Cells of [`Kind::Integer`].
    Integers(Vec<Option<i64>>),
    /// Cells of [`Kind::Boolean`].
    Booleans(Vec<Option<bool>>),
    /// Cells of [`Kind::Words`]: indices into [`Table::words`](crate::Table::words).
    Words(Vec<Option<u32>>),
    /// Cells of [`Kind::Time`].
    Times(Vec<Option<Time>>),
}

impl Cells {
    pub(crate) fn of(kind: Kind) -> Self {
        match kind {
            Kind::Number => Self::Numbers(Vec::new()),
            Kind::Integer => Self::Integers(Vec::new()),
            Kind::Boolean => Self::Booleans(Vec::new()),
            Kind::Words | Kind::Text => Self::Words(Vec::new()),
            Kind::Time => Self::Times(Vec::new()),
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Integers(cells) => cells.len(),
            Self::Booleans(cells) => cells.len(),
            Self::Words(cells) => cells.len(),
            Self::Times(cells) => cells.len(),
        }
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn truncate(&mut self, rows: usize) {
        match self {
            Self::Numbers(cells) => cells.truncate(rows),
            Self::Integers(cells) => cells.truncate(rows),
            Self::Booleans(cells) => cells.truncate(rows),
            Self::Words(cells) => cells.truncate(rows),
            Self::Times(cells) => cells.truncate(rows),
        }
    }

    /// A cell as a double: numbers as they are, booleans as 0 and 1, words as their indices, times as seconds. `Err` holds a whole number
    /// of 64 bits, or the time, if it is no double.
    ///
    /// # Errors
    /// If the cell is no double.
    pub fn number(&self, row: usize) -> Result<Option<f64>, String> {
        match self {
            Self::Numbers(cells) => Ok(cells.get(row).copied().flatten()),
            Self::Booleans(cells) => Ok(cells.get(row).copied().flatten().map(|yes| f64::from(u8::from(yes)))),
            Self::Words(cells) => Ok(cells.get(row).copied().flatten().map(f64::from)),
            Self::Integers(cells) => match cells.get(row).copied().flatten() {
                None => Ok(None),
                Some(whole) if (whole as f64) as i128 == i128::from(whole) => Ok(Some(whole as f64)),
                Some(whole) => Err(whole.to_string()),
            },
            Self::Times(cells) => match cells.get(row).copied().flatten() {
                None => Ok(None),
                Some(time) if time.decimals() <= 6 && time.seconds().abs() < 9e9 => Ok(Some(time.seconds())),
                Some(time) => Err(time.shown(crate::Scale::Seconds, 18)),
            },
        }
    }
}

/// On which side of its number a cell says that the measurement is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `<0.25`.
    Below,
    /// `>40`.
    Above,
}

/// Rows of a table, by columns.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Batch {
    /// Number of rows.
    pub rows: usize,
    /// Where each row stands.
    pub places: Vec<Place>,
    /// The time of each row; empty if the table has none.
    pub times: Vec<Time>,
    /// Cells of the columns that were selected, in their order.
    pub columns: Vec<Cells>,
    /// Cells of limits ([`Table::take_limits`](crate::Table::take_limits)): place of the column in `columns`, row of the batch, side of the number.
    pub limits: Vec<(usize, usize, Side)>,
}

impl Batch {
    pub(crate) fn reset(&mut self, kinds: impl Iterator<Item = Kind>) {
        let kinds: Vec<Kind> = kinds.collect();
        let fits = self.columns.len() == kinds.len()
            && self
                .columns
                .iter()
                .zip(&kinds)
                .all(|(cells, kind)| std::mem::discriminant(cells) == std::mem::discriminant(&Cells::of(*kind)));
        if fits {
            self.columns.iter_mut().for_each(|cells| cells.truncate(0));
        } else {
            self.columns = kinds.into_iter().map(Cells::of).collect();
        }
        self.rows = 0;
        self.limits.clear();
        self.places.clear();
        self.times.clear();
    }

    pub(crate) fn cut(&mut self) {
        let rows = self.rows;
        self.columns.iter_mut().for_each(|cells| cells.truncate(rows));
        self.limits.retain(|limit| limit.1 < rows);
        self.places.truncate(rows);
        self.times.truncate(rows);
    }
}
