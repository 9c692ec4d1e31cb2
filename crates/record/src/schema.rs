//! What a recording holds: columns with their promises, time, the size of blocks.

use crate::bound::{Bound, Promise};
use crate::error::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive};

/// Most cells (rows times columns, time included) of one block: what a reader may have to hold.
pub const MAX_CELLS: usize = 1 << 24;
/// Most bytes of a name or a unit.
const MAX_NAME: usize = 1 << 10;
/// Largest number of cells around a circle: the codec's indices stay exact.
const MAX_CIRCLE_CELLS: f64 = (1_u64 << 40) as f64;

/// One column: name, unit, promise.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
    /// Size of the range that a share refers to, where it is fixed beforehand.
    pub(crate) range: Option<f64>,
}

impl Column {
    /// A column without a unit.
    ///
    /// # Errors
    /// If the name is longer than 1024 bytes, an absolute bound is not positive with a finite double, a share is not in `(0, 1]`, or
    /// decimals are above 15.
    pub fn new(name: impl Into<String>, bound: Bound) -> Result<Self, Error> {
        Ok(Self {
            name: text("name", name.into())?,
            unit: String::new(),
            bound: bound.checked()?,
            period: None,
            range: None,
        })
    }

    /// The unit that samples are in; only shown.
    ///
    /// # Errors
    /// If it is longer than 1024 bytes.
    pub fn with_unit(self, unit: impl Into<String>) -> Result<Self, Error> {
        Ok(Self {
            unit: text("unit", unit.into())?,
            ..self
        })
    }

    /// Samples are directions on a circle of this circumference (360 for degrees): the bound holds around the circle, and restored
    /// values lie in `[0, period)`. Without effect on lossless columns.
    ///
    /// # Errors
    /// If `period` is not positive and finite, above `2^40` times the bound, or the column is to keep decimals.
    pub fn with_period(self, period: f64) -> Result<Self, Error> {
        positive("period", period)?;
        if let Bound::Decimals(places) = self.bound {
            let expected = "an absolute bound, a share or lossless for a column on a circle";
            return Err(ArgumentError::new("bound", format!("decimals:{places}"), expected).into());
        }
        let smallest = match self.bound {
            Bound::Absolute(delta) => delta,
            Bound::ShareOfRange(share) => share * period,
            Bound::Lossless | Bound::Decimals(_) => period,
        };
        if smallest.is_nan() || period / smallest > MAX_CIRCLE_CELLS {
            return Err(ArgumentError::new("period", period, "at most 2^40 times the bound").into());
        }
        Ok(Self {
            period: Some(period),
            ..self
        })
    }

    /// The range that a share refers to, if it is known beforehand. Without it, it is the range of the rows so far; on a circle it
    /// is the period.
    ///
    /// # Errors
    /// If an end is not finite or `from` is above `to`.
    pub fn with_range(self, from: f64, to: f64) -> Result<Self, Error> {
        finite("from", from)?;
        finite("to", to)?;
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

    /// The promise.
    pub fn bound(&self) -> Bound {
        self.bound
    }

    /// Circumference, if samples are directions.
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// Whether a restored cell keeps what the column promises of a sample: gaps, NaN and infinities the same bits, finite samples within
    /// the bound. `share_bound` is that of the block ([`Block::share_bounds`](crate::Block::share_bounds)), for columns with a share.
    pub fn keeps(&self, sample: Option<f64>, restored: Option<f64>, share_bound: Option<f64>) -> bool {
        let (Some(sample), Some(restored)) = (sample, restored) else {
            return sample.is_none() && restored.is_none();
        };
        if sample.to_bits() == restored.to_bits() || !sample.is_finite() || !restored.is_finite() {
            return sample.to_bits() == restored.to_bits();
        }
        self.promise(share_bound.unwrap_or(0.0))
            .holds(sample, restored, self.period)
    }

    /// The promise of a block; `share_bound` is what a share means there, 0 for lossless.
    pub(crate) fn promise(&self, share_bound: f64) -> Promise {
        match self.bound {
            Bound::Lossless => Promise::Exact,
            Bound::Absolute(delta) => Promise::Within(delta),
            Bound::Decimals(places) => Promise::Decimals(places),
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

/// How a tick is written for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeFormat {
    /// A number of seconds.
    Seconds,
    /// Coordinated universal time since 1970, as in RFC 3339.
    Utc,
}

/// When rows were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeBase {
    /// Rows have no time. Their ticks are whole numbers that count up by one; a jump says that rows are missing.
    Numbered,
    /// Ticks of `10^-decimals` seconds.
    Clock {
        /// Decimals of a second in one tick, at most 18.
        decimals: u8,
        /// Restored ticks are at most this many ticks off; 0 for exact times.
        tolerance: u64,
        /// How ticks are written.
        format: TimeFormat,
    },
}

/// Largest tolerance of time, in ticks.
const MAX_TOLERANCE: u64 = 1 << 52;

impl TimeBase {
    /// How far a restored tick may be off.
    pub fn tolerance(self) -> u64 {
        match self {
            Self::Numbered => 0,
            Self::Clock { tolerance, .. } => tolerance,
        }
    }
}

/// Everything that a recording's header says.
#[derive(Debug, Clone, PartialEq)]
pub struct Schema {
    pub(crate) columns: Vec<Column>,
    pub(crate) time: TimeBase,
    pub(crate) rows_per_block: usize,
}

/// Rows of a block unless another number is chosen.
pub const ROWS_PER_BLOCK: usize = 512;

impl Schema {
    /// Blocks of 512 rows.
    ///
    /// # Errors
    /// If there is no column, there are more than 4096, two have one name, a clock has more than 18 decimals or its tolerance is above
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
        Ok(Self {
            columns,
            time,
            rows_per_block: ROWS_PER_BLOCK,
        })
    }

    /// Blocks of this many rows. Small blocks lose less when one is lost and wait less on a link; each costs 7 to 10 bytes and
    /// begins to learn anew.
    ///
    /// # Errors
    /// If `rows` is 0 or a block would have more than [`MAX_CELLS`] cells.
    pub fn with_rows_per_block(self, rows: usize) -> Result<Self, Error> {
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

    /// When rows were taken.
    pub fn time(&self) -> TimeBase {
        self.time
    }

    /// Rows of a whole block.
    pub fn rows_per_block(&self) -> usize {
        self.rows_per_block
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// If there is none of this name.
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
