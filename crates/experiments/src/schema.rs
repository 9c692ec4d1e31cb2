//! Tables ready to be written: typed rows become named columns with units and meanings.
//!
//! A figure's result is a plain value: `Vec<Row>`, or a struct of such lists whose first field is the main table. The fields of
//! a row *are* the columns ([`rows!`](crate::rows!)): their documentation is the meaning, `Option` may be empty, and a
//! [`Measured`] fills two columns (`mse`, `mse_se`).

use crate::error::Error;
use crate::measured::Measured;
use serde::Serialize;
use std::fmt;

/// A column: its name in the CSV header, its unit and what it holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Name in the header: lower case with underscores.
    pub name: String,
    /// Unit; empty for pure numbers and labels.
    pub unit: &'static str,
    /// What the column holds, in a few words.
    pub meaning: String,
    /// What it is in the default plot.
    #[serde(skip)]
    pub role: Role,
    /// What it is called in a plot; its meaning if empty.
    #[serde(skip)]
    pub label: String,
    /// The panels that it is drawn in; none for the only one.
    #[serde(skip)]
    pub panels: &'static [&'static str],
}

/// What a column is in the default plot ([`plotted`](crate::plotted)), as [`rows!`](crate::rows!) writes it behind the type of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(non_camel_case_types, reason = "words of a macro")]
pub enum Role {
    /// Not drawn.
    #[default]
    data,
    /// Each of its values has a panel.
    panel,
    /// The horizontal axis.
    x,
    /// Names lines below one another; what is drawn lies across.
    ladder,
    /// Each of its values has a curve.
    key,
    /// Drawn as a solid line.
    line,
    /// Drawn as a dashed line: a bound or a reference.
    dashed,
    /// Drawn as marks, with error bars where it is a [`Measured`].
    points,
    /// Drawn as a line through marks.
    curve,
}

/// Which trial counts the references of a row need, as [`rows!`](crate::rows!) names them.
#[doc(hidden)]
#[allow(non_upper_case_globals, reason = "words of a macro")]
pub mod efforts {
    pub const full_trials: bool = true;
}

impl Column {
    /// A column of this name, unit and documentation.
    pub fn of(name: &str, unit: &'static str, documentation: &str) -> Self {
        Self {
            name: name.trim_start_matches("r#").to_owned(),
            unit,
            meaning: on_one_line(documentation),
            role: Role::data,
            label: String::new(),
            panels: &[],
        }
    }

    /// With what it is in the default plot, what it is called there, and in which panels.
    #[must_use]
    pub fn drawn(self, role: Role, label: &str, panels: &'static [&'static str]) -> Self {
        let label = label.to_owned();
        Self {
            role,
            label,
            panels,
            ..self
        }
    }
}

/// A documentation comment on one line.
pub(crate) fn on_one_line(documentation: &str) -> String {
    documentation.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// One entry of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number.
    Number(f64),
    /// A count or an index.
    Integer(i64),
    /// A label.
    Text(String),
    /// No value: an empty field.
    Missing,
}

impl Value {
    /// The number that it is.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Integer(count) => Some(*count as f64),
            Self::Text(_) | Self::Missing => None,
        }
    }
}

/// Numbers are written with the shortest digits that read back to the same bits.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(x) if *x != 0.0 && !(1e-4..1e15).contains(&x.abs()) && x.is_finite() => write!(f, "{x:e}"),
            // A negative zero is written as zero.
            Self::Number(x) => write!(f, "{}", x + 0.0),
            Self::Integer(i) => write!(f, "{i}"),
            Self::Text(text) => f.write_str(text),
            Self::Missing => Ok(()),
        }
    }
}

/// Rows under named columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Name in file names; the main table's is `main`.
    pub name: String,
    /// What it holds.
    pub meaning: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// A cell for each column.
    pub rows: Vec<Vec<Value>>,
    /// The key of each row, by which its references are found; none for rows without.
    #[serde(skip)]
    pub keys: Vec<Option<String>>,
    /// Whether its references are compared with at full trial counts only.
    #[serde(skip)]
    pub at_full_trials: bool,
}

impl Table {
    /// The tables of a figure's result, main table first.
    ///
    /// # Errors
    /// If a cell is not finite: what did not converge must say so.
    pub fn of<T: Field>(result: &T) -> Result<Vec<Self>, Error> {
        let mut cells = Cells::default();
        result.put(&mut cells);
        let mut tables = tables::<T>();
        for (table, (rows, keys)) in tables.iter_mut().zip(cells.tables) {
            for (index, row) in rows.iter().enumerate() {
                for (column, cell) in table.columns.iter().zip(row) {
                    if let Value::Number(number) = cell
                        && !number.is_finite()
                    {
                        let place = format!("column `{}`, row {index} of `{}`", column.name, table.name);
                        return Err(Error::failed(format_args!("table: {number} in {place}")));
                    }
                }
            }
            (table.rows, table.keys) = (rows, keys);
        }
        Ok(tables)
    }

    /// The number of a row in column `i`, with its standard error where the next column holds it.
    pub(crate) fn measured(&self, row: &[Value], i: usize) -> Option<Measured> {
        let error = format!("{}_se", self.columns[i].name);
        let next = self.columns.get(i + 1).filter(|next| next.name == error);
        let error = next.and_then(|_| row.get(i + 1)?.number());
        Some(Measured::new(row.get(i)?.number()?, error))
    }

    /// Name of the CSV file in the figure of this id.
    pub fn file(&self, id: &str) -> String {
        match self.name.as_str() {
            "main" => format!("{id}.csv"),
            name => format!("{id}-{name}.csv"),
        }
    }
}

/// The columns and tables of a type, in the order of its fields.
#[derive(Debug, Default)]
pub struct Described {
    columns: Vec<Column>,
    pub(crate) tables: Vec<Table>,
}

impl Described {
    /// Number of columns so far.
    #[doc(hidden)]
    pub fn described(&self) -> usize {
        self.columns.len()
    }

    /// Gives the columns from `first` on, those of a row within a row, the role of that row.
    #[doc(hidden)]
    pub fn draw(&mut self, first: usize, row: Column) {
        if row.role != Role::data {
            for column in &mut self.columns[first..] {
                (column.role, column.panels) = (row.role, row.panels);
            }
            self.columns[first..]
                .iter_mut()
                .take(1)
                .for_each(|column| column.label.clone_from(&row.label));
        }
    }
}

/// Rows of a table, and the reference key of each.
pub(crate) type Keyed = (Vec<Vec<Value>>, Vec<Option<String>>);

/// The cells of a row, or the rows of the tables, in the order in which [`Described`] has columns and tables.
#[derive(Debug, Default)]
pub struct Cells {
    cells: Vec<Value>,
    pub(crate) tables: Vec<Keyed>,
}

/// A field of a row (a number, a label, a [`Measured`], an `Option` of these, another row, whose columns are then this row's too)
/// or of a figure's tables (a list of rows). [`rows!`](crate::rows!) writes it for rows.
pub trait Field {
    /// Adds the columns of a field of this name, or the table.
    fn describe(about: Column, to: &mut Described) {
        to.columns.push(about);
    }

    /// Adds the cells, or the rows of the table.
    fn put(&self, to: &mut Cells);

    /// What a row is found by: what follows the quantity in the keys of its references.
    fn found_by(&self) -> Option<String> {
        None
    }

    /// Whether its references are compared with at full trial counts only: it is no plain average of trials.
    fn at_full_trials() -> bool {
        false
    }
}

/// Fields of one column.
macro_rules! cells {
    ($($type:ty: $cell:expr;)*) => {$(
        impl Field for $type {
            fn put(&self, to: &mut Cells) {
                let cell: fn(&Self) -> Value = $cell;
                to.cells.push(cell(self));
            }
        }
    )*};
}

fn count<T: Copy + TryInto<i64>>(count: T, number: f64) -> Value {
    count.try_into().map_or(Value::Number(number), Value::Integer)
}

cells! {
    f64: |x| Value::Number(*x);
    bool: |flag| Value::Text(flag.to_string());
    u8: |n| Value::Integer((*n).into());
    u32: |n| Value::Integer((*n).into());
    u64: |n| count(*n, *n as f64);
    usize: |n| count(*n, *n as f64);
    String: |text| Value::Text(text.clone());
    &'static str: |text| Value::Text((*text).to_owned());
}

/// Whether something is so: `yes` or `no`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer(pub bool);

impl Field for Answer {
    fn put(&self, to: &mut Cells) {
        let word = if self.0 { "yes" } else { "no" };
        word.put(to);
    }
}

/// Several values in one cell, with blanks between them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct List<T>(pub Vec<T>);

impl<T: ToString> Field for List<T> {
    fn put(&self, to: &mut Cells) {
        let words: Vec<String> = self.0.iter().map(T::to_string).collect();
        words.join(" ").put(to);
    }
}

impl Field for Measured {
    fn describe(about: Column, to: &mut Described) {
        let error = Column {
            name: format!("{}_se", about.name),
            meaning: format!("{} (its standard error)", about.meaning),
            ..Column::of("", about.unit, "")
        };
        to.columns.extend([about, error]);
    }

    fn put(&self, to: &mut Cells) {
        self.value.put(to);
        self.standard_error.put(to);
    }
}

/// No columns and no table.
impl Field for () {
    fn describe(_: Column, _: &mut Described) {}

    fn put(&self, _: &mut Cells) {}
}

impl<T: Field> Field for Option<T> {
    fn describe(about: Column, to: &mut Described) {
        T::describe(about, to);
    }

    fn put(&self, to: &mut Cells) {
        match self {
            Some(field) => field.put(to),
            None => to.cells.extend(columns::<T>().iter().map(|_| Value::Missing)),
        }
    }
}

/// Columns of one meaning, numbered from 1.
impl<T: Field, const N: usize> Field for [T; N] {
    fn describe(about: Column, to: &mut Described) {
        for number in 1..=N {
            let name = format!("{}{number}", about.name);
            let label = about.label.replace("{}", &number.to_string());
            let own = about.clone();
            T::describe(Column { name, label, ..own }, to);
        }
    }

    fn put(&self, to: &mut Cells) {
        self.iter().for_each(|field| field.put(to));
    }
}

/// The main table has no name.
impl<T: Field> Field for Vec<T> {
    fn describe(about: Column, to: &mut Described) {
        let name = match to.tables.as_slice() {
            [] => "main".to_owned(),
            _ => about.name.replace('_', "-"),
        };
        to.tables.push(Table {
            name,
            meaning: about.meaning,
            columns: columns::<T>(),
            rows: Vec::new(),
            keys: Vec::new(),
            at_full_trials: T::at_full_trials(),
        });
    }

    fn put(&self, to: &mut Cells) {
        let cells = |row: &T| {
            let mut cells = Cells::default();
            row.put(&mut cells);
            cells.cells
        };
        to.tables
            .push((self.iter().map(cells).collect(), self.iter().map(Field::found_by).collect()));
    }
}

/// The columns that `T` describes.
fn columns<T: Field>() -> Vec<Column> {
    let mut all = Described::default();
    T::describe(Column::of("", "", ""), &mut all);
    all.columns
}

/// The tables that `T` describes.
pub(crate) fn tables<T: Field>() -> Vec<Table> {
    let mut all = Described::default();
    T::describe(Column::of("", "", ""), &mut all);
    all.tables
}

#[cfg(test)]
mod tests;
