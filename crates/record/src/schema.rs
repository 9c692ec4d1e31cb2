//! The schema of a recording: its columns, time, size of blocks.

use crate::column::{Column, text};
use crate::error::{Error, ensure, listed};

/// Largest number of cells (rows times columns, time included) of one block, which a reader must hold in memory.
pub const MAX_CELLS: usize = 1 << 24;

/// Text form of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeFormat {
    /// A number of seconds.
    Seconds,
    /// Coordinated universal time since 1970, as in RFC 3339.
    Utc,
    /// Time since 1970 on a clock whose zone is not known, as in RFC 3339 without an offset.
    Local,
}

/// How rows are related to time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeBase {
    /// Rows have no time. Their ticks are integers that increase by one; a jump means missing rows.
    Numbered,
    /// Ticks of `10^-decimals` seconds.
    Clock {
        /// Number of decimals of a second, at most 18.
        decimals: u8,
        /// Largest error of restored ticks; 0 for exact times.
        tolerance: u64,
        /// Text form of ticks.
        format: TimeFormat,
    },
}

/// Largest allowed tolerance in ticks.
const MAX_TOLERANCE: u64 = 1 << 52;

impl TimeBase {
    /// Largest error of a restored tick.
    pub fn tolerance(self) -> u64 {
        match self {
            Self::Numbered => 0,
            Self::Clock { tolerance, .. } => tolerance,
        }
    }
}

/// Columns, time and size of blocks of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Schema {
    pub(crate) columns: Vec<Column>,
    pub(crate) time: TimeBase,
    pub(crate) rows_per_block: usize,
    /// Whether a writer moves no tick, although there is a tolerance.
    pub(crate) keeps_ticks: bool,
    /// Name of the times; empty if it is the usual one.
    pub(crate) time_name: String,
}

/// Largest number of columns.
pub(crate) const MAX_COLUMNS: usize = 4096;
/// Name of the times of a recording that states none.
pub(crate) const TIME_NAME: &str = "time";

/// Default number of rows per block, for tables of few columns: a damaged block loses its rows, and larger ones save hardly a bit.
pub const ROWS_PER_BLOCK: usize = 1 << 16;
/// Largest number of cells of a block of default size: a reader of one row decodes all of them.
const DEFAULT_CELLS: usize = 1 << 20;
/// Smallest default number of rows per block.
const LEAST_ROWS: usize = 512;

/// Number of rows per block if none is asked for.
pub(crate) fn default_rows(columns: usize) -> usize {
    (DEFAULT_CELLS / columns.max(1)).clamp(LEAST_ROWS, ROWS_PER_BLOCK)
}

impl Schema {
    /// A schema with blocks of [`ROWS_PER_BLOCK`] rows; of fewer, if there are more than 16 columns.
    ///
    /// # Errors
    /// If there is no column, there are more than 4096, two have the same name, a clock has more than 18 decimals or its tolerance exceeds
    /// `2^52`.
    pub fn new(columns: Vec<Column>, time: TimeBase) -> Result<Self, Error> {
        ensure!((1..=MAX_COLUMNS).contains(&columns.len()), "columns", columns.len(), "1 to 4096 columns");
        let mut names: Vec<&str> = columns.iter().map(Column::name).collect();
        names.sort_unstable();
        for pair in names.windows(2) {
            ensure!(pair[0] != pair[1], "columns", format!("`{}` twice", pair[0]), "a name of its own for each");
        }
        if let TimeBase::Clock {
            decimals, tolerance, ..
        } = time
        {
            ensure!(decimals <= 18, "decimals", decimals, "at most 18 decimals of a second");
            ensure!(tolerance <= MAX_TOLERANCE, "tolerance", tolerance, "at most 2^52 ticks");
        }
        let rows_per_block = default_rows(columns.len());
        Ok(Self {
            columns,
            time,
            rows_per_block,
            keeps_ticks: false,
            time_name: String::new(),
        })
    }

    /// Sets the name of the times, for outputs as tables; it is `time` if none is set. No effect on numbered rows.
    ///
    /// # Errors
    /// If it is longer than 1024 bytes.
    pub fn with_time_name(self, name: impl Into<String>) -> Result<Self, Error> {
        let mut time_name = text("name", name.into())?;
        if time_name == TIME_NAME || self.time == TimeBase::Numbered {
            time_name.clear();
        }
        Ok(Self { time_name, ..self })
    }

    /// The name of the times.
    pub fn time_name(&self) -> &str {
        if self.time_name.is_empty() {
            TIME_NAME
        } else {
            &self.time_name
        }
    }

    /// Declares that ticks were restored from a recording with this tolerance: a recorder returns them exactly, so that the stated
    /// tolerance still holds for the original ones.
    #[must_use]
    pub fn with_restored_ticks(mut self) -> Self {
        self.keeps_ticks = true;
        self
    }

    /// Sets the number of rows per block; [`ROWS_PER_BLOCK`] stands for the default of this many columns. With small blocks fewer rows are lost with a block, and rows wait less on a link. Each block
    /// costs 7 to 10 bytes, and its models start anew.
    ///
    /// # Errors
    /// If `rows` is 0 or a block would have more than [`MAX_CELLS`] cells.
    pub fn with_rows_per_block(self, rows: usize) -> Result<Self, Error> {
        // The default holds for any number of columns.
        let is_default = rows == ROWS_PER_BLOCK;
        let default = default_rows(self.columns.len());
        self.with_exact_rows(if is_default { default } else { rows })
    }

    /// As [`with_rows_per_block`](Self::with_rows_per_block), for what a header states.
    pub(crate) fn with_exact_rows(mut self, rows: usize) -> Result<Self, Error> {
        let limit = MAX_CELLS / (self.columns.len() + 1);
        ensure!((1..=limit).contains(&rows), "rows_per_block", rows, format!("1 to {limit} rows"));
        self.rows_per_block = rows;
        Ok(self)
    }

    /// The columns, in their order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// How rows are related to time.
    pub fn time(&self) -> TimeBase {
        self.time
    }

    /// Number of rows of a full block.
    pub fn rows_per_block(&self) -> usize {
        self.rows_per_block
    }

    /// Index of a column.
    ///
    /// # Errors
    /// If there is no column of this name.
    pub fn position(&self, name: &str) -> Result<usize, Error> {
        self.columns
            .iter()
            .position(|column| column.name == name)
            .ok_or_else(|| Error::UnknownColumn {
                name: name.to_owned(),
                existing: listed(self.columns.iter().map(Column::name)),
            })
    }
}
