//! Rows that are not encoded yet.

use crate::block::{Cells, Rows};
use crate::header::Header;
use crate::ranges::Ranges;
use crate::schema::Schema;
use fewbits_block_codec::{ArgumentError, Effort};

/// Rows in the order of their arrival.
#[derive(Debug)]
pub(crate) struct Waiting {
    pub(crate) ticks: Vec<i64>,
    pub(crate) columns: Vec<Cells>,
    /// Ranges of all rows so far, including those that were removed.
    pub(crate) ranges: Ranges,
}

impl Waiting {
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            ticks: Vec::new(),
            columns: vec![Vec::new(); columns],
            ranges: Ranges::new(columns),
        }
    }

    /// Adds one row.
    ///
    /// # Errors
    /// If the number of cells is not that of the columns. Nothing is added then.
    pub(crate) fn push(&mut self, tick: i64, row: &[Option<f64>]) -> Result<(), ArgumentError> {
        if row.len() != self.columns.len() {
            let expected = format!("{} cells, one per column", self.columns.len());
            return Err(ArgumentError::new("row", format!("{} cells", row.len()), expected));
        }
        self.ticks.push(tick);
        self.ranges.add(row);
        for (cells, cell) in self.columns.iter_mut().zip(row) {
            cells.push(*cell);
        }
        Ok(())
    }

    /// The first rows as those of the block of this number.
    pub(crate) fn first<'a>(&'a self, rows: usize, header: &'a Header, number: u64, effort: Effort) -> Rows<'a> {
        Rows {
            header,
            number,
            ticks: &self.ticks[..rows],
            columns: self.columns.iter().map(|cells| &cells[..rows]).collect(),
            own_bounds: self.ranges.own_bounds(header),
            effort,
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
