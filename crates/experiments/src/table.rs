//! Tables ready to be written: typed rows become named columns with units and meanings.
//!
//! A figure's result is a plain value: `Vec<Row>`, or a struct of such lists whose first field is the main table. The fields of
//! a row *are* the columns ([`rows!`](crate::rows!)): their documentation is the meaning, `Option` may be empty, and a
//! [`Measured`](crate::Measured) fills two columns (`mse`, `mse_se`). A cell that is not finite is an error: what did not converge
//! must say so.

use crate::error::Error;
use crate::schema::{self, Cells, Column, Field, Fields, Value};
use serde::Serialize;
use std::borrow::Cow;

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
    /// If a cell is not finite, or there is no table.
    pub fn of<T: Field>(rows: &T) -> Result<Self, Error> {
        let mut cells = Cells::default();
        rows.put(&mut cells);
        Self::filled(schema::tables::<T>(), cells.tables)
    }

    fn filled(described: Vec<Fields>, rows: Vec<Vec<Vec<Value>>>) -> Result<Self, Error> {
        let volatile = described.iter().filter(|table| table.volatile);
        let volatile = volatile.map(|table| table.name.clone().into()).collect();
        let mut tables = Vec::new();
        for (Fields { name, columns, .. }, rows) in described.into_iter().zip(rows) {
            for (index, row) in rows.iter().enumerate() {
                for (column, cell) in columns.iter().zip(row) {
                    if let Value::Number(number) = cell
                        && !number.is_finite()
                    {
                        return Err(Error::Table(format!(
                            "{number} in column `{}`, row {index} of `{name}`",
                            column.name
                        )));
                    }
                }
            }
            tables.push((Cow::Owned(name), Table { columns, rows }));
        }
        let mut tables = tables.into_iter();
        let (_, main) = tables.next().ok_or_else(|| Error::Table("no table".to_owned()))?;
        Ok(Self {
            main,
            further: tables.collect(),
            volatile,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measured;

    #[derive(Debug)]
    enum Method {
        Lloyd,
    }
    schema::label!(Method);

    rows! {
        struct Key {
            method: Method => "How.",
        }

        struct Row {
            key: Key,
            time: f64 ["s"] => "Time.",
            /// Squared error,
            /// in square metres.
            mse: Measured ["m^2"],
            other: Option<Measured> => "Of another.",
            printed: Option<f64> => "As printed.",
        }

        struct Two {
            rows: Vec<Row> => "Main.",
            run_times: Vec<Count> ["time"] => "Counts.",
        }

        struct Count {
            n: u64 => "A count.",
        }
    }

    fn row(time: f64) -> Row {
        let mse = Measured {
            value: 2.0,
            standard_error: Some(0.5),
        };
        Row {
            key: Key { method: Method::Lloyd },
            time,
            mse,
            other: None,
            printed: None,
        }
    }

    #[test]
    fn the_fields_are_the_columns() {
        let table = Tables::of(&vec![row(1.0)]).unwrap().main;
        let cells: Vec<_> = table
            .columns()
            .iter()
            .zip(&table.rows()[0])
            .map(|(c, v)| format!("{}[{}]={v}", c.name, c.unit))
            .collect();
        let expected = [
            "method[]=lloyd",
            "time[s]=1",
            "mse[m^2]=2",
            "mse_se[m^2]=0.5",
            "other[]=",
            "other_se[]=",
            "printed[]=",
        ];
        assert_eq!(cells, expected);
        assert_eq!(table.columns()[3].meaning, "Squared error, in square metres. (its standard error)");
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

    #[test]
    fn arrays_are_columns_numbered_from_one() {
        rows! {
            struct Pair {
                f: [f64; 2] ["V"] => "Both.",
            }
        }
        let tables = Tables::of(&vec![Pair { f: [1.0, 2.0] }]).unwrap();
        let names: Vec<_> = tables.main.columns().iter().map(|c| c.name.as_ref()).collect();
        assert_eq!(names, ["f1", "f2"]);
    }
}
