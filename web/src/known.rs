//! Rows in memory, and what is known of them.

use fewbits_recipes::{Batch, Failure, Source};
use fewbits_record::TimeBase;
use serde::Serialize;

/// Rows that are read at once.
pub(crate) const ROWS: usize = 4096;
/// Largest number of columns of a recording.
const MAX_COLUMNS: usize = 4096;

/// All rows, and what is known of them.
pub(crate) struct Rows {
    pub(crate) batch: Batch,
    pub(crate) columns: Vec<Known>,
    pub(crate) time: TimeBase,
    pub(crate) time_name: String,
    pub(crate) found: Found,
}

/// What is known of a column.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Known {
    pub(crate) name: String,
    /// Its unit, or the list of its words.
    pub(crate) unit: String,
    pub(crate) kind: &'static str,
    pub(crate) words: Option<Vec<String>>,
    pub(crate) samples: usize,
    pub(crate) gaps: usize,
    /// Smallest and largest finite number.
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    /// A value that few cells have and that makes most of the range.
    pub(crate) sentinel: Option<f64>,
    pub(crate) sentinel_cells: u64,
    /// The circumference, if samples are directions.
    pub(crate) period: Option<f64>,
}

/// How the table was understood, in words.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Found {
    pub(crate) format: String,
    /// Options of the command line that say all that was detected, and those that the user said.
    pub(crate) dialect: String,
    pub(crate) options: String,
    pub(crate) time: Option<FoundTime>,
    /// Columns that hold no numbers, and why.
    pub(crate) left_out: Vec<(String, String)>,
    /// Lines that were left out, and what repeats.
    pub(crate) skipped: Vec<String>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct FoundTime {
    pub(crate) columns: Vec<String>,
    pub(crate) scale: &'static str,
    pub(crate) from: String,
    pub(crate) to: String,
}

/// Rows of a batch, some at a time.
pub(crate) struct Pieces<'a> {
    batch: &'a Batch,
    next: usize,
}

impl<'a> Pieces<'a> {
    pub(crate) fn new(batch: &'a Batch) -> Self {
        Self { batch, next: 0 }
    }
}

impl Source for Pieces<'_> {
    fn next_batch(&mut self) -> Result<Option<Batch>, Failure> {
        let from = self.next;
        self.next = (from + ROWS).min(self.batch.rows());
        let rows = from..self.next;
        Ok((!rows.is_empty()).then(|| Batch {
            ticks: self.batch.ticks.as_ref().map(|ticks| ticks[rows.clone()].to_vec()),
            columns: self
                .batch
                .columns
                .iter()
                .map(|cells| cells[rows.clone()].to_vec())
                .collect(),
        }))
    }
}

/// Refuses more columns than a recording has.
pub(crate) fn check_columns(rows: &Rows) -> Result<(), String> {
    match rows.columns.len() {
        0 => Err("no column has numbers or few words: nothing can be packed".to_owned()),
        count if count > MAX_COLUMNS => {
            Err(format!("{count} columns, and a recording has at most {MAX_COLUMNS}: leave some out"))
        }
        _ => Ok(()),
    }
}
