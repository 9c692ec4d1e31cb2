//! What the fields of a row say about themselves: names, units and meanings of columns, and their cells.

use crate::measured::Measured;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;

/// A column: its name in the CSV header, its unit and what it holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Name in the header: lower case with underscores.
    pub name: Cow<'static, str>,
    /// Unit; empty for pure numbers and labels.
    pub unit: Cow<'static, str>,
    /// What the column holds, in a few words.
    pub meaning: Cow<'static, str>,
}

impl Column {
    /// A column of this name, unit and documentation.
    pub fn of(name: &str, unit: &'static str, documentation: &str) -> Self {
        Self {
            name: name.trim_start_matches("r#").to_owned().into(),
            unit: unit.into(),
            meaning: on_one_line(documentation).into(),
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

/// A table as its rows describe it.
#[derive(Debug, Clone, PartialEq)]
pub struct Fields {
    /// Name in file names; the main table's is `main`.
    pub name: String,
    /// What it holds.
    pub meaning: String,
    /// Whether it holds measured times.
    pub volatile: bool,
    pub(crate) columns: Vec<Column>,
}

impl Fields {
    /// The columns.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter()
    }
}

/// The columns and tables of a type, in the order of its fields.
#[derive(Debug, Default)]
pub struct Described {
    columns: Vec<Column>,
    pub(crate) tables: Vec<Fields>,
}

/// The cells of a row, or the rows of the tables, in the order in which [`Described`] has columns and tables.
#[derive(Debug, Default)]
pub struct Cells {
    cells: Vec<Value>,
    pub(crate) tables: Vec<Vec<Vec<Value>>>,
}

/// A field of a row (a number, a label, a [`Measured`], an `Option` of these, another row, whose columns are then this row's too)
/// or of a figure's tables (a list of rows). [`rows!`](crate::rows!) writes it for rows.
pub trait Field {
    /// Columns of the field.
    const COLUMNS: usize = 1;

    /// Adds the columns of a field of this name, or the table.
    fn describe(about: Column, to: &mut Described) {
        to.columns.push(about);
    }

    /// Adds the cells, or the rows of the table.
    fn put(&self, to: &mut Cells);
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
    u16: |n| Value::Integer((*n).into());
    u32: |n| Value::Integer((*n).into());
    i32: |n| Value::Integer((*n).into());
    i64: |n| Value::Integer(*n);
    u64: |n| count(*n, *n as f64);
    usize: |n| count(*n, *n as f64);
    String: |text| Value::Text(text.clone());
    &'static str: |text| Value::Text((*text).to_owned());
    Cow<'static, str>: |text| Value::Text(text.clone().into_owned());
}

/// A label is its variant in lower case.
macro_rules! label {
    ($type:ty) => {
        impl $crate::schema::Field for $type {
            fn put(&self, to: &mut $crate::schema::Cells) {
                format!("{self:?}").to_lowercase().put(to);
            }
        }
    };
}
pub(crate) use label;

impl Field for Measured {
    const COLUMNS: usize = 2;

    fn describe(about: Column, to: &mut Described) {
        let error = Column {
            name: format!("{}_se", about.name).into(),
            unit: about.unit.clone(),
            meaning: format!("{} (its standard error)", about.meaning).into(),
        };
        to.columns.extend([about, error]);
    }

    fn put(&self, to: &mut Cells) {
        self.value.put(to);
        self.standard_error.put(to);
    }
}

impl<T: Field> Field for Option<T> {
    const COLUMNS: usize = T::COLUMNS;

    fn describe(about: Column, to: &mut Described) {
        T::describe(about, to);
    }

    fn put(&self, to: &mut Cells) {
        match self {
            Some(field) => field.put(to),
            None => to.cells.extend((0..T::COLUMNS).map(|_| Value::Missing)),
        }
    }
}

/// Columns of one meaning, numbered from 1.
impl<T: Field, const N: usize> Field for [T; N] {
    const COLUMNS: usize = N * T::COLUMNS;

    fn describe(about: Column, to: &mut Described) {
        for number in 1..=N {
            let name = format!("{}{number}", about.name).into();
            T::describe(Column { name, ..about.clone() }, to);
        }
    }

    fn put(&self, to: &mut Cells) {
        self.iter().for_each(|field| field.put(to));
    }
}

/// The main table has no name. One of measured times has the unit `"time"`.
impl<T: Field> Field for Vec<T> {
    fn describe(about: Column, to: &mut Described) {
        let mut row = Described::default();
        T::describe(Column::of("", "", ""), &mut row);
        to.tables.push(Fields {
            name: if to.tables.is_empty() {
                "main".to_owned()
            } else {
                about.name.replace('_', "-")
            },
            meaning: about.meaning.into_owned(),
            volatile: about.unit == "time",
            columns: row.columns,
        });
    }

    fn put(&self, to: &mut Cells) {
        let cells = |row: &T| {
            let mut cells = Cells::default();
            row.put(&mut cells);
            cells.cells
        };
        to.tables.push(self.iter().map(cells).collect());
    }
}

/// The tables that `T` describes.
pub(crate) fn tables<T: Field>() -> Vec<Fields> {
    let mut all = Described::default();
    T::describe(Column::of("", "", ""), &mut all);
    all.tables
}
