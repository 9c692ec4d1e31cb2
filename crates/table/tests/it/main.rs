//! Tables of every kind that people have, with inputs of our own. Expected values are written out, or those of another reader.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod again;
mod codes;
mod dialects;
mod doubts;
mod faults;
mod frames;
mod fresh;
mod kinds;
mod layouts;
mod limits;
mod loggers;
mod long;
#[cfg(feature = "parquet")]
mod parquet;
mod plain;
mod random;
mod recordings;
mod refused;
mod spellings;
mod stated;
mod strangers;
mod times;
mod unseen;

use fewbits_table::{Batch, Cells, Dialect, Error, Table};

/// A table as a person gives it: nothing said, the time found.
fn open(text: &str) -> Table {
    let mut table = Table::open(std::io::Cursor::new(text.to_owned()), &Dialect::default()).unwrap();
    table.find_time().unwrap();
    table
}

fn open_said(text: &str, said: &Dialect) -> Result<Table, Error> {
    Table::open(std::io::Cursor::new(text.to_owned()), said)
}

/// All rows of a table.
fn rows(table: &mut Table) -> Batch {
    let mut batch = Batch::default();
    table.read(&mut batch, 1_000_000).unwrap();
    assert_eq!(table.read(&mut Batch::default(), 1).unwrap(), 0);
    batch
}

fn numbers(cells: &Cells) -> Vec<Option<f64>> {
    (0..cells.len()).map(|row| cells.number(row).unwrap()).collect()
}

fn seconds(batch: &Batch) -> Vec<f64> {
    batch.times.iter().map(|time| time.seconds()).collect()
}

/// The refusal of the first row that is refused.
fn refusal(table: &mut Table) -> String {
    let mut batch = Batch::default();
    loop {
        match table.read(&mut batch, 1) {
            Ok(0) => panic!("nothing was refused"),
            Ok(_) => {}
            Err(error) => return error.to_string(),
        }
    }
}
