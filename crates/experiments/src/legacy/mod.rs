//! The idiom before typed rows, for the figures that have not moved yet. It goes when the last one has.

pub mod claim;
mod figure;
mod table;

pub use crate::error::Error;
pub use crate::figure::{About, Context};
pub use crate::row;
pub use claim::{Claim, Expected};
pub use figure::{Figure, Old};
pub use table::{Column, Table, Tables, Value, column};

impl From<Claim> for crate::Claim {
    fn from(old: Claim) -> Self {
        Self {
            id: old.id,
            statement: old.statement,
            verdict: old.verdict,
            value: old.value,
            expected: old.expected,
            tolerance: old.tolerance,
            at_defaults: false,
            full_effort: false,
            absent: false,
        }
    }
}

impl From<Value> for crate::Value {
    fn from(old: Value) -> Self {
        match old {
            Value::Number(number) => Self::Number(number),
            Value::Integer(integer) => Self::Integer(integer),
            Value::Text(text) => Self::Text(text),
            Value::Missing => Self::Missing,
        }
    }
}

impl From<Table> for crate::Table {
    fn from(old: Table) -> Self {
        let column = |c: &Column| crate::Column {
            name: c.name.into(),
            unit: c.unit.into(),
            meaning: c.meaning.into(),
        };
        let row = |row: &Vec<Value>| row.iter().cloned().map(Into::into).collect();
        Self {
            columns: old.columns().iter().map(column).collect(),
            rows: old.rows().iter().map(row).collect(),
        }
    }
}

impl From<Tables> for crate::Tables {
    fn from(old: Tables) -> Self {
        Self {
            main: old.main.into(),
            further: old
                .further
                .into_iter()
                .map(|(name, table)| (name.into(), table.into()))
                .collect(),
            volatile: old.volatile.into_iter().map(Into::into).collect(),
        }
    }
}
