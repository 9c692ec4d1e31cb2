//! The schema of a recording: columns with their error bounds, time, size of blocks.

use crate::bound::{Bound, Promise};
use crate::error::Error;
use fewbits_block_codec::ArgumentError;

/// Largest number of cells (rows times columns, time included) of one block, which a reader must hold in memory.
pub const MAX_CELLS: usize = 1 << 24;
/// Largest length of a name or a unit in bytes.
const MAX_NAME: usize = 1 << 10;
/// Largest number of cells on a circle, for which the codec's indices are exact.
const MAX_CIRCLE_CELLS: f64 = (1_u64 << 40) as f64;

/// One column: name, unit, error bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
    /// Size of the range that a share refers to, if it is known beforehand.
    pub(crate) range: Option<f64>,
    /// The bound of the recordings that the samples come from, which adds to the column's own.
    pub(crate) earlier: f64,
}

impl Column {
    /// A column without a unit.
    ///
    /// # Errors
    /// If the name is longer than 1024 bytes, an absolute bound is not positive or its double not finite, a share is not in `(0, 1]`, or
    /// there are more than 15 decimals.
    pub fn new(name: impl Into<String>, bound: Bound) -> Result<Self, Error> {
        Ok(Self {
            name: text("name", name.into())?,
            unit: String::new(),
            bound: bound.checked()?,
            period: None,
            range: None,
            earlier: 0.0,
        })
    }

    /// Declares that the samples were restored from a recording within this bound, in units of the column (0: exactly). The distance
    /// from the original samples is then at most the sum of both bounds, which [`keeps`](Self::keeps) allows.
    ///
    /// # Errors
    /// If it is negative or not finite, or is above 0 while the bound is [`Bound::Decimals`] or [`Bound::Relative`], to which none can be
    /// added.
    pub fn with_earlier_bound(self, earlier: f64) -> Result<Self, Error> {
        if !(earlier >= 0.0 && (2.0 * earlier).is_finite()) {
            return Err(
                ArgumentError::new("earlier", earlier, "zero or a positive number whose double is finite").into()
            );
        }
        if earlier > 0.0 && matches!(self.bound, Bound::Decimals(_) | Bound::Relative { .. }) {
            let expected = "an absolute bound, a share of the range or lossless for a column with an earlier bound";
            return Err(ArgumentError::new("bound", format!("{:?}", self.bound), expected).into());
        }
        Ok(Self { earlier, ..self })
    }

    /// Sets the unit of the samples, which is only shown to users.
    ///
    /// # Errors
    /// If it is longer than 1024 bytes.
    pub fn with_unit(self, unit: impl Into<String>) -> Result<Self, Error> {
        Ok(Self {
            unit: text("unit", unit.into())?,
            ..self
        })
    }

    /// Declares that samples are directions on a circle of this circumference (360 for degrees). The bound then holds around the circle,
    /// and restored values lie in `[0, period)`. No effect on lossless columns.
    ///
    /// # Errors
    /// If `period` is not positive and finite, exceeds `2^40` times the bound, or the bound is [`Bound::Decimals`] or
    /// [`Bound::Relative`].
    pub fn with_period(self, period: f64) -> Result<Self, Error> {
        ArgumentError::positive("period", period)?;
        if let Bound::Decimals(_) | Bound::Relative { .. } = self.bound {
            let expected = "an absolute bound, a share of the range or lossless for a column on a circle";
            return Err(ArgumentError::new("bound", format!("{:?}", self.bound), expected).into());
        }
        let smallest = match self.bound {
            Bound::Absolute(delta) => delta,
            Bound::ShareOfRange(share) => share * period,
            Bound::Lossless | Bound::Decimals(_) | Bound::Relative { .. } => period,
        };
        if smallest.is_nan() || period / smallest > MAX_CIRCLE_CELLS {
            return Err(ArgumentError::new("period", period, "at most 2^40 times the bound").into());
        }
        Ok(Self {
            period: Some(period),
            ..self
        })
    }

    /// Sets the range that a share refers to, if it is known beforehand. Without it, it is the range of the rows so far, or on a circle
    /// the period.
    ///
    /// # Errors
    /// If an end is not finite or `from` is above `to`.
    pub fn with_range(self, from: f64, to: f64) -> Result<Self, Error> {
        ArgumentError::finite("from", from)?;
        ArgumentError::finite("to", to)?;
        let range = to - from;
        if range.is_nan() || range < 0.0 || range == f64::INFINITY {
            return Err(
                ArgumentError::new("range", format!("{from} to {to}"), "a finite range, `from` below `to`").into()
            );
        }
        Ok(Self {
            range: Some(range),
            ..self
        })
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The unit; empty if there is none.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// The error bound.
    pub fn bound(&self) -> Bound {
        self.bound
    }

    /// The bound of the recordings that the samples come from ([`with_earlier_bound`](Self::with_earlier_bound)); 0 if there are none.
    pub fn earlier_bound(&self) -> f64 {
        self.earlier
    }

    /// Circumference of the circle, if samples are directions.
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// Whether a restored cell is within the bound of a sample. Gaps, NaN and infinities must have the same bits. `share_bound` is that of
    /// the block ([`Block::share_bounds`](crate::Block::share_bounds)), for columns with a share.
    pub fn keeps(&self, sample: Option<f64>, restored: Option<f64>, share_bound: Option<f64>) -> bool {
        let (Some(sample), Some(restored)) = (sample, restored) else {
            return sample.is_none() && restored.is_none();
        };
        if sample.to_bits() == restored.to_bits() || !sample.is_finite() || !restored.is_finite() {
            return sample.to_bits() == restored.to_bits();
        }
        self.whole_promise(share_bound.unwrap_or(0.0))
            .holds(sample, restored, self.period)
    }

    /// The bound relative to the original samples: with that of the recordings that the samples come from.
    fn whole_promise(&self, share_bound: f64) -> Promise {
        match self.promise(share_bound) {
            promise if self.earlier == 0.0 => promise,
            // The sum may have been rounded down, and both bounds can be reached.
            Promise::Within(delta) => Promise::Within((delta + self.earlier).next_up()),
            _ => Promise::Within(self.earlier),
        }
    }

    /// The bound in a block; `share_bound` is the value of a share there, 0 for lossless.
    pub(crate) fn promise(&self, share_bound: f64) -> Promise {
        match self.bound {
            Bound::Lossless => Promise::Exact,
            Bound::Absolute(delta) => Promise::Within(delta),
            Bound::Decimals(places) => Promise::Decimals(places),
            Bound::Relative { share, floor } => Promise::Relative { share, floor },
            Bound::ShareOfRange(_) if share_bound > 0.0 => Promise::Within(share_bound),
            Bound::ShareOfRange(_) => Promise::Exact,
        }
    }

    /// The size of the range that a share refers to, if it is known before the first row.
    pub(crate) fn known_range(&self) -> Option<f64> {
        self.period.or(self.range)
    }
}

fn text(name: &'static str, text: String) -> Result<String, ArgumentError> {
    if text.len() > MAX_NAME {
        return Err(ArgumentError::new(name, format!("{} bytes long", text.len()), "at most 1024 bytes"));
    }
    Ok(text)
}

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
        if columns.is_empty() || columns.len() > 4096 {
            return Err(ArgumentError::new("columns", columns.len(), "1 to 4096 columns").into());
        }
        let mut names: Vec<&str> = columns.iter().map(Column::name).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(
                ArgumentError::new("columns", format!("`{}` twice", pair[0]), "a name of its own for each").into()
            );
        }
        if let TimeBase::Clock {
            decimals, tolerance, ..
        } = time
        {
            if decimals > 18 {
                return Err(ArgumentError::new("decimals", decimals, "at most 18 decimals of a second").into());
            }
            if tolerance > MAX_TOLERANCE {
                return Err(ArgumentError::new("tolerance", tolerance, "at most 2^52 ticks").into());
            }
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
    pub fn with_restored_ticks(self) -> Self {
        Self {
            keeps_ticks: true,
            ..self
        }
    }

    /// Sets the number of rows per block; [`ROWS_PER_BLOCK`] stands for the default of this many columns. With small blocks fewer rows are lost with a block, and rows wait less on a link. Each block
    /// costs 7 to 10 bytes, and its models start anew.
    ///
    /// # Errors
    /// If `rows` is 0 or a block would have more than [`MAX_CELLS`] cells.
    pub fn with_rows_per_block(self, rows: usize) -> Result<Self, Error> {
        match rows {
            // The default holds for any number of columns.
            ROWS_PER_BLOCK => {
                let rows = default_rows(self.columns.len());
                self.with_exact_rows(rows)
            }
            rows => self.with_exact_rows(rows),
        }
    }

    /// As [`with_rows_per_block`](Self::with_rows_per_block), for what a header states.
    pub(crate) fn with_exact_rows(self, rows: usize) -> Result<Self, Error> {
        let limit = MAX_CELLS / (self.columns.len() + 1);
        if rows == 0 || rows > limit {
            return Err(ArgumentError::new("rows_per_block", rows, format!("1 to {limit} rows")).into());
        }
        Ok(Self {
            rows_per_block: rows,
            ..self
        })
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
                existing: self.columns.iter().map(Column::name).collect::<Vec<_>>().join(", "),
            })
    }
}
