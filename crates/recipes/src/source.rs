//! Rows in batches of columns, and progress.

use crate::error::{Error, Failure};
use std::ops::ControlFlow;

/// Rows of a table, by columns.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// The tick of each row; `None` if rows have no times.
    pub ticks: Option<Vec<i64>>,
    /// A column of cells per name, all of the same length; `None` is a gap.
    pub columns: Vec<Vec<Option<f64>>>,
}

impl Batch {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        match &self.ticks {
            Some(ticks) => ticks.len(),
            None => self.columns.first().map_or(0, Vec::len),
        }
    }

    /// Checks the number of columns, and that all have the same length.
    ///
    /// # Errors
    /// If they have not.
    pub fn check(&self, columns: usize) -> Result<(), Error> {
        let refused = |found, expected| Err(Error::Batch { found, expected });
        if self.columns.len() != columns {
            return refused(self.columns.len(), columns);
        }
        match self.columns.iter().find(|column| column.len() != self.rows()) {
            Some(column) => refused(column.len(), self.rows()),
            None => Ok(()),
        }
    }
}

/// Where rows come from: a file, a pipe, a table of another program.
pub trait Source {
    /// The next rows, at least one; `None` after the last.
    ///
    /// # Errors
    /// If the rows cannot be read. [`Error::Source`] hands the failure on as it is.
    fn next_batch(&mut self) -> Result<Option<Batch>, Failure>;
}

/// One batch as a source.
#[derive(Debug, Clone)]
pub struct Columns(Option<Batch>);

impl Columns {
    /// A source of these rows.
    pub fn new(batch: Batch) -> Self {
        Self(Some(batch).filter(|batch| batch.rows() > 0))
    }
}

impl Source for Columns {
    fn next_batch(&mut self) -> Result<Option<Batch>, Failure> {
        Ok(self.0.take())
    }
}

/// What a recipe has done so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Progress {
    /// Rows, or with [`plan`](crate::plan) columns, that are done.
    pub done: u64,
}

impl Progress {
    pub(crate) fn new(done: u64) -> Self {
        Self { done }
    }
}

/// A callback between batches. `Break` stops the recipe with [`Error::Stopped`].
pub type Watch<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// Reports progress.
pub(crate) fn report(watch: &mut Watch<'_>, done: u64) -> Result<(), Error> {
    match watch(Progress::new(done)) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Stopped),
    }
}
