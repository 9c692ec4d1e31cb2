//! Why a table was refused, where, and what would mend it.

/// Where a fault is: the file's own line, counted from 1 (0 if the format has none), and the row of data, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Place {
    /// Line of the file at which the row begins; lines before the names, comments and blank lines count.
    pub line: u64,
    /// Row of data.
    pub row: u64,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.line, self.row) {
            (0, row) => write!(f, "row {row}"),
            (line, 0) => write!(f, "line {line}"),
            (line, row) => write!(f, "line {line} (row {row})"),
        }
    }
}

/// Errors of tables. Messages say what would mend the fault, in words of the command line's options.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The source could not be read.
    #[error("cannot read")]
    Io(#[from] std::io::Error),
    /// The first bytes are those of another kind of file.
    #[error("this is {what}: {mend}")]
    Format {
        /// What the file is.
        what: &'static str,
        /// What to do.
        mend: &'static str,
    },
    /// A line could not be split into the cells of a row.
    #[error("{place}: {problem}: {mend}")]
    Line {
        /// Where.
        place: Place,
        /// What is wrong.
        problem: String,
        /// What to do.
        mend: &'static str,
    },
    /// A cell is not what its column holds.
    #[error("{place}, column `{column}`: `{cell}` {problem}: {mend}")]
    Cell {
        /// Where.
        place: Place,
        /// Name of the column.
        column: String,
        /// The cell, at most 80 characters of it.
        cell: String,
        /// What is wrong.
        problem: &'static str,
        /// What to do.
        mend: String,
    },
    /// The dates of a column may have the day or the month first, or all are one day and may have the year first, by the first rows. All rows may decide:
    /// [`Profile::day_order`](crate::Profile::day_order).
    #[error("{place}, column `{column}`: `{cell}` {problem}: {mend}")]
    DayOrMonth {
        /// Where.
        place: Place,
        /// Name of the column.
        column: String,
        /// The cell, at most 80 characters of it.
        cell: String,
        /// What is open.
        problem: &'static str,
        /// What to do.
        mend: String,
    },
    /// There is no such column.
    #[error("no column `{column}`: there are {existing}")]
    NoColumn {
        /// The name that was asked for.
        column: String,
        /// Names of the table, at most 20.
        existing: String,
    },
    /// A setting was refused.
    #[error("{option}: `{value}` is not understood: expected {expected}")]
    Option {
        /// The option.
        option: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: String,
    },
    /// No column is surely the time.
    #[error(
        "no column has times, and the first, `{column}`, does not increase: name the column of times with --time-column, or leave --time out"
    )]
    NoTime {
        /// Name of the first column.
        column: String,
    },
    /// There is no line of names.
    #[error("the file is empty: a line of names and rows are expected")]
    Empty,
    /// A Parquet file was refused.
    #[cfg(feature = "parquet")]
    #[error("the Parquet file is damaged or of a kind that cannot be read")]
    Parquet(#[from] parquet::errors::ParquetError),
    /// A column of a Parquet file was refused.
    #[cfg(feature = "parquet")]
    #[error("column `{column}` is of type {kind}: {mend}")]
    Type {
        /// Name of the column.
        column: String,
        /// Arrow's name of the type.
        kind: String,
        /// What to do.
        mend: &'static str,
    },
}

/// Names for a message: at most 20 of them.
pub(crate) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names = names.into_iter().map(printable);
    let mut text: Vec<String> = names.by_ref().take(20).collect();
    match names.count() {
        0 => {}
        more => text.push(format!("and {more} more")),
    }
    text.join(", ")
}

/// Text of a file without control characters, so that it cannot drive a terminal, and at most 80 characters of it.
pub fn printable(text: &str) -> String {
    let mut shown: String = text
        .chars()
        .take(80)
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if text.chars().nth(80).is_some() {
        shown.push('…');
    }
    shown
}

impl Error {
    pub(crate) fn option(option: &'static str, value: &str, expected: impl Into<String>) -> Self {
        Self::Option {
            option,
            value: value.to_owned(),
            expected: expected.into(),
        }
    }

    /// The refusal of a line that is no row yet.
    pub(crate) fn line(line: u64, problem: impl Into<String>, mend: &'static str) -> Self {
        Self::Line {
            place: Place { line, row: 0 },
            problem: problem.into(),
            mend,
        }
    }

    /// Whether dates may have the day or the month first, which rows behind the first ones may decide: [`Profile::day_order`].
    ///
    /// [`Profile::day_order`]: crate::Profile::day_order
    pub fn is_day_or_month(&self) -> bool {
        matches!(self, Self::DayOrMonth { .. })
    }

    /// Where the fault is, if it is that of one row: what [`Dialect::skip_bad`](crate::Dialect::skip_bad) may leave out.
    pub fn place(&self) -> Option<Place> {
        match self {
            Self::Line { place, .. } | Self::Cell { place, .. } | Self::DayOrMonth { place, .. } => Some(*place),
            _ => None,
        }
    }
}
