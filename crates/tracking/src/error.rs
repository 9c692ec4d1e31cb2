//! Errors of this crate.

/// Why a row, a model or a report was refused.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Errors of this crate. A call that fails leaves what it was called on as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The source of rows failed.
    #[error(transparent)]
    Source(Failure),
    /// The source has no rows.
    #[error("no rows")]
    Empty,
    /// A field of the options is out of its range.
    #[error("{argument}: `{value}` is not understood: expected {expected}")]
    Argument {
        /// The field.
        argument: &'static str,
        /// Its value.
        value: String,
        /// What it should be.
        expected: &'static str,
    },
    /// A field of the options is needed, because the rows do not determine it.
    #[error("{argument} is needed: {reason}")]
    Needed {
        /// The field.
        argument: &'static str,
        /// Why it cannot be found.
        reason: &'static str,
    },
    /// A row was refused.
    #[error("row {row}")]
    Row {
        /// Its number.
        row: u64,
        /// Why.
        #[source]
        source: Failure,
    },
    /// A cell of a row, or its time, is not what the options say.
    #[error("row {row}: {problem}")]
    Content {
        /// The number of the row.
        row: u64,
        /// What is wrong, and what would mend it.
        problem: String,
    },
    /// A sensor of the rows is none of those that were stated.
    #[error("`{name}` is not known")]
    Unknown {
        /// Its name.
        name: String,
    },
    /// The rooms of a leak are not as they should be.
    #[error("{problem}")]
    Rooms {
        /// What is wrong.
        problem: String,
    },
    /// The options, or the rows, do not give a valid model.
    #[error("{what}")]
    Refused {
        /// What was refused.
        what: &'static str,
        /// Why.
        #[source]
        source: Failure,
    },
}

impl Error {
    pub(crate) fn refused(what: &'static str) -> impl Fn(Failure) -> Self {
        move |source| Self::Refused { what, source }
    }

    pub(crate) fn row(row: u64) -> impl Fn(Failure) -> Self {
        move |source| Self::Row { row, source }
    }
}
