//! Tables of the old idiom, whose columns are looked up by name.

use crate::error::Error;
use serde::Serialize;
use std::fmt;

/// One entry of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A finite number or an infinity.
    Number(f64),
    /// A count or an index.
    Integer(i64),
    /// A label.
    Text(String),
    /// No value: an empty field.
    Missing,
}

impl Value {
    /// The entry as a number, if it is one.
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Integer(integer) => Some(*integer as f64),
            Self::Text(_) | Self::Missing => None,
        }
    }
}

/// Numbers are written with the shortest digits that read back to the same bits.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(x) if *x != 0.0 && !(1e-4..1e15).contains(&x.abs()) && x.is_finite() => write!(f, "{x:e}"),
            Self::Number(x) => write!(f, "{x}"),
            Self::Integer(i) => write!(f, "{i}"),
            Self::Text(text) => f.write_str(text),
            Self::Missing => Ok(()),
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for Value {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Missing, Self::Number)
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        Self::Integer(count as i64)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Self::Integer(count as i64)
    }
}

impl From<u32> for Value {
    fn from(count: u32) -> Self {
        Self::Integer(i64::from(count))
    }
}

impl From<i64> for Value {
    fn from(integer: i64) -> Self {
        Self::Integer(integer)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// A column: its name in the CSV header, its unit and what it holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Name in the header: lower case with underscores.
    pub name: &'static str,
    /// Unit; empty for pure numbers and labels.
    pub unit: &'static str,
    /// What the column holds, in a few words.
    pub meaning: &'static str,
}

/// A column.
pub const fn column(name: &'static str, unit: &'static str, meaning: &'static str) -> Column {
    Column { name, unit, meaning }
}

/// Rows under named columns.
///
/// ```
/// use fewbits_experiments::legacy::{column, row, Table};
/// let mut table = Table::new([column("gamma", "", "noise ratio"), column("mse", "unit^2", "mean squared error")]);
/// table.push(row![0.5, 0.7296])?;
/// assert_eq!(table.numbers("mse")?, [0.7296]);
/// # Ok::<(), fewbits_experiments::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<Value>>,
}

/// Builds a row for [`Table::push`] from anything that turns into a [`Value`].
#[macro_export]
macro_rules! row {
    ($($value:expr),* $(,)?) => { vec![$($crate::legacy::Value::from($value)),*] };
}

impl Table {
    /// An empty table.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self {
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
        }
    }

    /// Appends a row.
    ///
    /// # Errors
    /// If its length differs from the number of columns, or it holds NaN.
    pub fn push(&mut self, row: Vec<Value>) -> Result<(), Error> {
        if row.len() != self.columns.len() {
            return Err(Error::Table(format!(
                "row of {} values in a table of {} columns",
                row.len(),
                self.columns.len()
            )));
        }
        if let Some(at) = row.iter().position(|v| matches!(v, Value::Number(x) if x.is_nan())) {
            return Err(Error::Table(format!("NaN in column `{}` of row {}", self.columns[at].name, self.rows.len())));
        }
        self.rows.push(row);
        Ok(())
    }

    /// The columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The rows.
    pub fn rows(&self) -> &[Vec<Value>] {
        &self.rows
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn position(&self, name: &str) -> Result<usize, Error> {
        self.columns
            .iter()
            .position(|c| c.name == name)
            .ok_or_else(|| Error::Table(format!("no column `{name}`")))
    }

    /// A column of numbers.
    ///
    /// # Errors
    /// If there is no such column, or an entry is no number.
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, Error> {
        let at = self.position(name)?;
        self.rows
            .iter()
            .map(|row| {
                row[at]
                    .as_number()
                    .ok_or_else(|| Error::Table(format!("column `{name}` holds `{}`", row[at])))
            })
            .collect()
    }

    /// A column as text.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, Error> {
        let at = self.position(name)?;
        Ok(self.rows.iter().map(|row| row[at].to_string()).collect())
    }

    /// The rows in which column `name` equals `value` (numbers are compared exactly), as a table of the same columns.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn only(&self, name: &str, value: impl Into<Value>) -> Result<Self, Error> {
        let at = self.position(name)?;
        let value = value.into();
        let same = |entry: &Value| match (entry.as_number(), value.as_number()) {
            (Some(a), Some(b)) => a == b,
            _ => entry == &value,
        };
        Ok(Self {
            columns: self.columns.clone(),
            rows: self.rows.iter().filter(|row| same(&row[at])).cloned().collect(),
        })
    }

    /// Pairs of two columns, leaving out rows in which either is missing: the points of a curve.
    ///
    /// # Errors
    /// If a column does not exist.
    pub fn points(&self, x: &str, y: &str) -> Result<Vec<(f64, f64)>, Error> {
        let (x, y) = (self.position(x)?, self.position(y)?);
        Ok(self
            .rows
            .iter()
            .filter_map(|row| Some((row[x].as_number()?, row[y].as_number()?)))
            .collect())
    }
}

/// The tables of one figure: the main one, written as `<id>.csv`, and further ones, written as `<id>-<name>.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tables {
    /// The main table.
    pub main: Table,
    /// Further tables by name.
    pub further: Vec<(&'static str, Table)>,
    /// Names of further tables that hold measured times, and so differ from run to run.
    pub volatile: Vec<&'static str>,
}

impl From<Table> for Tables {
    fn from(main: Table) -> Self {
        Self {
            main,
            further: Vec::new(),
            volatile: Vec::new(),
        }
    }
}

impl Tables {
    /// Adds a table.
    #[must_use]
    pub fn with(mut self, name: &'static str, table: Table) -> Self {
        self.further.push((name, table));
        self
    }

    /// Adds a table of measured times: the only one that may differ between two runs of the same command.
    #[must_use]
    pub fn with_volatile(mut self, name: &'static str, table: Table) -> Self {
        self.volatile.push(name);
        self.with(name, table)
    }

    /// The further table of the given name.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(&self, name: &str) -> Result<&Table, Error> {
        self.further
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, table)| table)
            .ok_or_else(|| Error::Table(format!("no table `{name}`")))
    }
}
