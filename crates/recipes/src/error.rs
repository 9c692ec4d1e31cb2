//! Errors of recipes.

use fewbits_table::printable;

/// Why a source could not give its next rows.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A bound is not in the language of bounds.
    #[error("bound `{bound}` is not understood: expected {expected}")]
    Bound {
        /// The part that was not understood.
        bound: String,
        /// What it should look like.
        expected: &'static str,
    },
    /// A value without a column's name would apply to all other columns, though it stands behind another value.
    #[error("`{text}`: `{part}` would apply to all other columns: write it first, or as `*={part}`{}", mend(.decimal.as_deref()))]
    Stray {
        /// The whole text.
        text: String,
        /// The part without a name.
        part: String,
        /// The value that was meant if the comma is a decimal comma.
        decimal: Option<String>,
    },
    /// A column, or `*`, has two values.
    #[error("`{text}`: `{name}` has two values: expected one for each column")]
    Twice {
        /// The whole text.
        text: String,
        /// The name.
        name: String,
    },
    /// A quote has no end, or text follows it.
    #[error("`{text}`: a quoted name ends with a quote, before a comma or `=`; write a quote within it twice")]
    Quote {
        /// The whole text.
        text: String,
    },
    /// The table has no column of this name.
    #[error("no column `{}`: there are {existing}{}", printable(.name), quoting(.existing))]
    NoColumn {
        /// The requested name.
        name: String,
        /// The existing names, separated by commas; the first ones if there are many.
        existing: String,
    },
    /// A column of a recording was refused.
    #[error("column `{}`", printable(.column))]
    Column {
        /// Its name.
        column: String,
        /// Why.
        #[source]
        source: fewbits_record::Error,
    },
    /// The text of a setting is not in its language.
    #[error("{setting}: `{value}` is not understood: expected {expected}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Its text.
        value: String,
        /// What it should look like.
        expected: &'static str,
    },
    /// Settings were refused, or do not go together.
    #[error("{what}")]
    Refused {
        /// The settings.
        what: &'static str,
        /// Why.
        #[source]
        source: Failure,
    },
    /// The recorder or the reader of a recording failed.
    #[error(transparent)]
    Record(#[from] fewbits_record::Error),
    /// The table was refused.
    #[error(transparent)]
    Table(#[from] fewbits_table::Error),
    /// The source of rows, or what takes them, failed.
    #[error(transparent)]
    Source(Failure),
    /// A batch has columns of different lengths, or not as many as expected.
    #[error("a batch has {found} cells: expected {expected}")]
    Batch {
        /// Number of columns, or of cells in one.
        found: usize,
        /// The expected number.
        expected: usize,
    },
    /// The callback stopped the recipe.
    #[error("stopped")]
    Stopped,
}

impl Error {
    /// The argument that the recorder or the reader refused, if that is the error.
    pub fn argument(&self) -> Option<&fewbits_record::ArgumentError> {
        match self {
            Self::Record(error) | Self::Column { source: error, .. } => error.argument(),
            _ => None,
        }
    }
}

fn mend(decimal: Option<&str>) -> String {
    decimal.map_or(String::new(), |decimal| format!("; a decimal point is a point: `{decimal}`"))
}

fn quoting(existing: &str) -> &'static str {
    if existing.contains('"') {
        "; names with commas stand in quotes"
    } else {
        ""
    }
}
