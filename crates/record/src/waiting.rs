//! Rows that are not encoded yet.

use crate::block::{Cells, Rows};
use crate::header::Header;
use crate::ranges::Ranges;
use crate::schema::Schema;
use fewbits_block_codec::{ArgumentError, Effort, ensure};

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

    /// Checks the number of columns, and of the cells of each.
    ///
    /// # Errors
    /// If they are others.
    pub(crate) fn check(
        &self,
        argument: &'static str,
        lengths: impl ExactSizeIterator<Item = usize>,
        rows: usize,
    ) -> Result<(), ArgumentError> {
        let (found, columns) = (lengths.len(), self.columns.len());
        let what = if argument == "row" { "cells" } else { "columns" };
        ensure!(found == columns, argument, format!("{found} {what}"), format!("{columns}, one per column"));
        for length in lengths {
            ensure!(length == rows, argument, format!("a column of {length} cells"), format!("{rows}, one per tick"));
        }
        Ok(())
    }

    /// Adds rows by columns, of each as many cells as ticks.
    pub(crate) fn extend<'a>(&mut self, ticks: &[i64], columns: impl Iterator<Item = &'a [Option<f64>]>) {
        self.ticks.extend_from_slice(ticks);
        for (column, (all, cells)) in self.columns.iter_mut().zip(columns).enumerate() {
            self.ranges.add(column, cells);
            all.extend_from_slice(cells);
        }
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
