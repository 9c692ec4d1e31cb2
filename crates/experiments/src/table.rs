//! Tables ready to be written: typed rows become named columns with units and meanings.
//!
//! A figure's result is a plain value: `Vec<Row>`, or a struct of such lists whose first field is the main table. The fields of
//! a row *are* the columns: their documentation is the meaning, `#[schemars(extend("unit" = "m"))]` the unit, `Option` may be
//! empty, a [`Measured`](crate::Measured) fills two columns (`mse`, `mse_se`), and a unit enum is a label. A cell that is not
//! finite is an error: what did not converge must say so.

use crate::error::Error;
use crate::schema::{self, Column, Fields};
use ciborium::Value as Cbor;
use schemars::JsonSchema;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;

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

/// Rows under named columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    pub(crate) columns: Vec<Column>,
    pub(crate) rows: Vec<Vec<Value>>,
}

impl Table {
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
}

/// The tables of one figure: the main one, written as `<id>.csv`, and further ones, written as `<id>-<name>.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tables {
    /// The main table.
    pub main: Table,
    /// Further tables by name.
    pub further: Vec<(Cow<'static, str>, Table)>,
    /// Names of further tables that hold measured times, and so differ from run to run.
    pub volatile: Vec<Cow<'static, str>>,
}

impl Tables {
    /// Turns typed rows into tables.
    ///
    /// # Errors
    /// If a cell is not finite, or a field is no number, label or [`Measured`](crate::Measured).
    pub fn of<T: Serialize + JsonSchema>(rows: &T) -> Result<Self, Error> {
        let bad = |reason: String| Error::Table(reason);
        let rows = Cbor::serialized(rows).map_err(|error| bad(error.to_string()))?;
        let mut tables = Vec::new();
        let mut volatile = Vec::new();
        for described in schema::tables::<T>() {
            let list = match &rows {
                Cbor::Array(list) => Some(list),
                other => entry(other, &described.key).and_then(Cbor::as_array),
            };
            let list = list.ok_or_else(|| bad(format!("`{}` is no list of rows", described.name)))?;
            let table = fill(&described, list)?;
            if described.volatile {
                volatile.push(described.name.clone().into());
            }
            tables.push((Cow::Owned(described.name), table));
        }
        let mut tables = tables.into_iter();
        let (_, main) = tables.next().ok_or_else(|| bad("no table".to_owned()))?;
        Ok(Self {
            main,
            further: tables.collect(),
            volatile,
        })
    }
}

fn entry<'a>(map: &'a Cbor, key: &str) -> Option<&'a Cbor> {
    let of = |(name, value): &'a (Cbor, Cbor)| (name.as_text() == Some(key)).then_some(value);
    map.as_map()?.iter().find_map(of)
}

fn fill(described: &Fields, list: &[Cbor]) -> Result<Table, Error> {
    let mut rows = Vec::with_capacity(list.len());
    for (index, row) in list.iter().enumerate() {
        let mut cells = Vec::with_capacity(described.columns.len());
        for (path, column) in &described.columns {
            let found = path
                .iter()
                .try_fold(row, |at, key| entry(at, key))
                .unwrap_or(&Cbor::Null);
            let refused = |reason: &str| {
                Error::Table(format!("{reason} in column `{}`, row {index} of `{}`", column.name, described.name))
            };
            cells.push(match found {
                Cbor::Null => Value::Missing,
                Cbor::Bool(flag) => Value::Text(flag.to_string()),
                Cbor::Text(text) => Value::Text(text.clone()),
                Cbor::Float(number) if number.is_finite() => Value::Number(*number),
                Cbor::Float(number) => return Err(refused(&format!("{number}"))),
                Cbor::Integer(integer) => {
                    Value::Integer(i64::try_from(*integer).map_err(|_| refused("a count beyond 63 bits"))?)
                }
                _ => return Err(refused("neither number nor label")),
            });
        }
        rows.push(cells);
    }
    let columns = described.columns.iter().map(|(_, column)| column.clone()).collect();
    Ok(Table { columns, rows })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measured;

    #[derive(Serialize, JsonSchema)]
    #[serde(rename_all = "kebab-case")]
    enum Method {
        LloydMax,
    }

    #[derive(Serialize, JsonSchema)]
    struct Key {
        /// How.
        method: Method,
    }

    #[derive(Serialize, JsonSchema)]
    struct Row {
        #[serde(flatten)]
        key: Key,
        /// Time.
        #[schemars(extend("unit" = "s"))]
        time: f64,
        /// Squared error.
        #[schemars(extend("unit" = "m^2"))]
        mse: Measured,
        /// Of another.
        other: Option<Measured>,
        /// As printed.
        printed: Option<f64>,
    }

    #[derive(Serialize, JsonSchema)]
    struct Two {
        /// Main.
        rows: Vec<Row>,
        /// Counts.
        #[schemars(extend("volatile" = true))]
        run_times: Vec<Count>,
    }

    #[derive(Serialize, JsonSchema)]
    struct Count {
        /// A count.
        n: u64,
    }

    fn row(time: f64) -> Row {
        let mse = Measured {
            value: 2.0,
            standard_error: Some(0.5),
        };
        Row {
            key: Key {
                method: Method::LloydMax,
            },
            time,
            mse,
            other: None,
            printed: None,
        }
    }

    #[test]
    fn the_fields_are_the_columns() {
        let table = Tables::of(&vec![row(1.0)]).unwrap().main;
        let mut cells: Vec<_> = table
            .columns()
            .iter()
            .zip(&table.rows()[0])
            .map(|(c, v)| format!("{}[{}]={v}", c.name, c.unit))
            .collect();
        cells.sort();
        let expected = [
            "method[]=lloyd-max",
            "mse[m^2]=2",
            "mse_se[m^2]=0.5",
            "other[]=",
            "other_se[]=",
            "printed[]=",
            "time[s]=1",
        ];
        assert_eq!(cells, expected);
        assert!(table.columns().iter().all(|c| !c.meaning.is_empty()));
    }

    #[test]
    fn a_struct_of_lists_is_several_tables() {
        let tables = Tables::of(&Two {
            rows: Vec::new(),
            run_times: vec![Count { n: 3 }],
        })
        .unwrap();
        assert_eq!((tables.main.len(), tables.main.columns().len()), (0, 7));
        assert_eq!((&*tables.further[0].0, tables.further[0].1.len()), ("run-times", 1));
        assert_eq!(tables.volatile, ["run-times"]);
    }

    #[test]
    fn a_cell_that_is_not_finite_is_refused_by_name() {
        for bad in [f64::NAN, f64::INFINITY] {
            let message = Tables::of(&vec![row(1.0), row(bad)]).unwrap_err().to_string();
            assert!(message.contains("`time`, row 1"), "{message}");
        }
    }
}
