//! A table as a source of recipes.

use crate::error::Error;
use crate::input::Table;
use fewbits_recipes::{Batch, Failure, Source};
use fewbits_record::TimeBase;

/// Number of rows per batch.
const ROWS: usize = 512;

/// Rows of a table in batches.
pub(crate) struct TableRows {
    table: Table,
    time: TimeBase,
}

impl TableRows {
    pub(crate) fn new(table: Table, time: TimeBase) -> Self {
        Self { table, time }
    }

    /// At most `limit` rows; `None` if there are none.
    pub(crate) fn take(&mut self, limit: usize) -> Result<Option<Batch>, Error> {
        let mut batch = Batch {
            ticks: (self.time != TimeBase::Numbered).then(Vec::new),
            columns: vec![Vec::new(); self.table.names.len()],
        };
        let mut rows = 0;
        while rows < limit
            && let Some((tick, cells)) = self.table.next(self.time)?
        {
            if let (Some(ticks), Some(tick)) = (&mut batch.ticks, tick) {
                ticks.push(tick);
            }
            for (column, cell) in batch.columns.iter_mut().zip(cells) {
                column.push(cell);
            }
            rows += 1;
        }
        // Without a column of times there are none, whatever the time base is.
        batch.ticks = batch.ticks.filter(|ticks| ticks.len() == rows);
        Ok((rows > 0).then_some(batch))
    }

    /// Reads all rows, so that a table that cannot be read is refused before anything is written. Returns their number.
    pub(crate) fn check(mut self) -> Result<u64, Error> {
        let mut rows = 0;
        while self.table.next(self.time)?.is_some() {
            rows += 1;
        }
        Ok(rows)
    }
}

impl Source for TableRows {
    fn next_batch(&mut self) -> Result<Option<Batch>, Failure> {
        Ok(self.take(ROWS)?)
    }
}
