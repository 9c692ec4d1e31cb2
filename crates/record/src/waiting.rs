//! Rows that are not encoded yet.

use crate::block::Cells;
use crate::header::Header;
use crate::ranges::Ranges;
use crate::schema::Schema;
use fewbits_block_codec::ArgumentError;
use std::ops::Range;

/// Rows in the order of their arrival.
#[derive(Debug)]
pub(crate) struct Waiting {
    pub(crate) ticks: Vec<i64>,
    pub(crate) columns: Vec<Cells>,
    /// Unknown ranges of all rows so far, including those that were removed.
    pub(crate) ranges: Ranges,
}

impl Waiting {
    pub(crate) fn new(schema: &Schema) -> Self {
        Self {
            ticks: Vec::new(),
            columns: vec![Vec::new(); schema.columns.len()],
            ranges: Ranges::new(schema),
        }
    }

    /// Adds one row.
    ///
    /// # Errors
    /// If the number of cells is not that of the columns. Nothing is added then.
    pub(crate) fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<(), ArgumentError> {
        self.check(row.len())?;
        self.ticks.push(tick);
        self.ranges.add(row);
        for (cells, cell) in self.columns.iter_mut().zip(row) {
            cells.push(*cell);
        }
        Ok(())
    }

    /// Checks that there is a cell, or a list of cells, for each column.
    pub(crate) fn check(&self, cells: usize) -> Result<(), ArgumentError> {
        if cells == self.columns.len() {
            return Ok(());
        }
        let expected = format!("{} cells, one per column", self.columns.len());
        Err(ArgumentError::new("row", format!("{cells} cells"), expected))
    }

    /// Adds cells of rows whose ticks were added. There are as many columns here.
    pub(crate) fn extend(&mut self, columns: &[Cells], rows: Range<usize>) {
        self.ranges.extend(columns, rows.clone());
        for (own, cells) in self.columns.iter_mut().zip(columns) {
            own.extend_from_slice(&cells[rows.clone()]);
        }
    }

    /// Removes the first rows.
    pub(crate) fn remove(&mut self, rows: usize) {
        self.ticks.drain(..rows);
        self.columns.iter_mut().for_each(|cells| drop(cells.drain(..rows)));
    }

    /// The header, without starts, of a recording that begins with these rows.
    pub(crate) fn header(&self, schema: &Schema) -> Header {
        Header::new(schema.clone(), &self.ticks, self.ranges.bounds(schema))
    }
}
