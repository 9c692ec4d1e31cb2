//! Errors of the command. Every message says where the error is and what to do.

use crate::say;
use std::io;

/// Why a model, a sensor, a report or a row was refused.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Errors of the command.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum Error {
    /// A file, a device or a socket could not be used.
    #[error("{place}: cannot {action}")]
    Io {
        place: String,
        action: &'static str,
        #[source]
        source: io::Error,
    },
    /// A recording was refused.
    #[error("{file}")]
    Recording {
        file: String,
        #[source]
        source: fewbits_record::Error,
    },
    /// A column of a recording was refused.
    #[error("{file}: column `{}`", say::name(.column))]
    Column {
        file: String,
        column: String,
        #[source]
        source: fewbits_record::Error,
    },
    /// A table could not be read.
    #[error("{file}")]
    Table {
        file: String,
        #[source]
        source: csv::Error,
    },
    /// A Parquet file could not be read or written.
    #[cfg(feature = "parquet")]
    #[error("{file}")]
    Parquet {
        file: String,
        #[source]
        source: Failure,
    },
    /// A Parquet file was given, but this program was built without Parquet.
    #[cfg(not(feature = "parquet"))]
    #[error("{file}: this program was built without Parquet: build it with `--features parquet`, or use CSV")]
    NoParquet { file: String },
    /// A table has no columns or no rows.
    #[error("{file}: no {what}: the first line names the columns, rows follow")]
    Empty { file: String, what: &'static str },
    /// The table has no column of this name.
    #[error("{file}: no column `{}`: there are {existing}", say::name(.column))]
    NoColumn {
        file: String,
        column: String,
        existing: String,
    },
    /// A table was refused by what reads it.
    #[error("{file}")]
    Refusal {
        file: String,
        #[source]
        source: Box<fewbits_table::Error>,
    },
    /// The value of an option could not be parsed.
    #[error("{option}: `{value}` is not understood: expected {expected}")]
    Option {
        option: &'static str,
        value: String,
        expected: &'static str,
    },
    /// A value is needed that the table does not determine.
    #[error("{option} is needed: {reason}")]
    Needed { option: &'static str, reason: &'static str },
    /// A row was refused by the recorder, filter or encoder.
    #[error("{file}: row {row}")]
    Row {
        file: String,
        row: u64,
        #[source]
        source: Failure,
    },
    /// The options do not give a valid model, sensor or design.
    #[error("{what}")]
    Refused {
        what: &'static str,
        #[source]
        source: Failure,
    },
    /// An output is an input, or another output.
    #[error("{output}: this is the same file as {other}: name another output")]
    SameFile { output: String, other: String },
    /// The name of an output ends as that of a file of another kind.
    #[error("{output}: {written} would be written, and the name ends in `.{ending}`: {mend}")]
    Ending {
        output: String,
        ending: String,
        written: &'static str,
        mend: &'static str,
    },
    /// Two of several files would be written to the same place.
    #[error("{output}: both {first} and {second} would be written there: give them other names, or pack them in turn")]
    SameOutput {
        output: String,
        first: String,
        second: String,
    },
    /// A recipe was refused.
    #[error("{file}")]
    Recipe {
        file: String,
        #[source]
        source: Box<fewbits_recipes::Error>,
    },
    /// Binary data would be written to a terminal.
    #[error("standard output is a terminal: name a file with --output, or redirect")]
    Terminal,
    /// A table, recording or configuration was read, but its content is not what the task needs.
    #[error("{file}: {problem}")]
    Content { file: String, problem: String },
    /// A centre or a sensor cannot continue.
    #[error(transparent)]
    Link(#[from] fewbits_link::Error),
    /// JSON could not be written.
    #[error("cannot write JSON")]
    Json(#[from] serde_json::Error),
}

impl Error {
    pub(crate) fn io(place: &str, action: &'static str) -> impl Fn(io::Error) -> Self + use<> {
        let place = place.to_owned();
        move |source| Self::Io {
            place: place.clone(),
            action,
            source,
        }
    }

    pub(crate) fn content(file: &str, problem: impl std::fmt::Display) -> Self {
        Self::Content {
            file: file.to_owned(),
            problem: problem.to_string(),
        }
    }

    pub(crate) fn empty(file: &str, what: &'static str) -> Self {
        Self::Empty {
            file: file.to_owned(),
            what,
        }
    }

    pub(crate) fn no_column(file: &str, column: &str, existing: &[String]) -> Self {
        Self::NoColumn {
            file: file.to_owned(),
            column: column.to_owned(),
            existing: fewbits_recipes::names::shown(existing),
        }
    }

    pub(crate) fn refused<E: std::error::Error + Send + Sync + 'static>(what: &'static str) -> impl Fn(E) -> Self {
        move |source| Self::Refused {
            what,
            source: Box::new(source),
        }
    }

    pub(crate) fn option(option: &'static str, value: &str, expected: &'static str) -> Self {
        Self::Option {
            option,
            value: value.to_owned(),
            expected,
        }
    }

    /// An error of a recipe on this file. What the source of rows reported stays as it was.
    pub(crate) fn recipe(file: &str) -> impl Fn(fewbits_recipes::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| match source {
            fewbits_recipes::Error::Source(failure) => match failure.downcast::<Self>() {
                Ok(error) => *error,
                Err(failure) => Self::content(&file, failure),
            },
            fewbits_recipes::Error::Record(source) => Self::recording(&file)(source),
            fewbits_recipes::Error::Table(source) => Self::of_table(&file)(source),
            source => Self::Recipe {
                file: file.clone(),
                source: Box::new(source),
            },
        }
    }

    /// An error of tracking the rows of this file. What the source of rows reported stays as it was.
    pub(crate) fn tracking(file: &str) -> impl Fn(fewbits_tracking::Error) -> Self + use<> {
        use fewbits_tracking::Error as Refusal;
        let file = file.to_owned();
        move |source| match source {
            Refusal::Source(failure) => match failure.downcast::<Self>() {
                Ok(error) => *error,
                Err(failure) => Self::content(&file, failure),
            },
            Refusal::Empty => Self::empty(&file, "rows"),
            Refusal::Argument {
                argument,
                value,
                expected,
            } => Self::option(option(argument), &value, expected),
            Refusal::Needed { argument, reason } => Self::Needed {
                option: option(argument),
                reason,
            },
            Refusal::Row { row, source } => Self::Row {
                file: file.clone(),
                row,
                source,
            },
            Refusal::Refused { what, source } => Self::Refused { what, source },
            problem => Self::content(&file, problem),
        }
    }

    pub(crate) fn of_table(file: &str) -> impl Fn(fewbits_table::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| Self::Refusal {
            file: file.clone(),
            source: Box::new(source),
        }
    }

    pub(crate) fn recording(file: &str) -> impl Fn(fewbits_record::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| Self::Recording {
            file: file.clone(),
            source,
        }
    }

    pub(crate) fn table(file: &str) -> impl Fn(csv::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| {
            let row = source.position().map_or(0, csv::Position::record);
            match source.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => Self::content(
                    &file,
                    format_args!(
                        "row {row}: {len} cells instead of {expected_len}: mend the row, or name what separates cells with \
                         --delimiter"
                    ),
                ),
                csv::ErrorKind::Utf8 { .. } => {
                    Self::content(&file, format_args!("row {row}: not text in UTF-8: save the table as UTF-8"))
                }
                _ => Self::Table {
                    file: file.clone(),
                    source,
                },
            }
        }
    }

    /// Whether the error is that the reader of the output has closed the pipe.
    pub(crate) fn is_closed_pipe(&self) -> bool {
        let kind = match self {
            Self::Io { source, .. } => source.kind(),
            Self::Json(error) => error.io_error_kind().unwrap_or(io::ErrorKind::Other),
            Self::Recording {
                source: fewbits_record::Error::Io { source, .. },
                ..
            } => source.kind(),
            Self::Table { source, .. } => match source.kind() {
                csv::ErrorKind::Io(error) => error.kind(),
                _ => return false,
            },
            _ => return false,
        };
        kind == io::ErrorKind::BrokenPipe
    }
}

/// The option that states an argument of tracking.
fn option(argument: &'static str) -> &'static str {
    match argument {
        "change" => "--change",
        "height" => "--height",
        "noise" => "--noise",
        "period" => "--period",
        "prior" => "--prior",
        "rounded" => "--rounded",
        "send" => "--send",
        "silent_within" => "--silent-within",
        "slope" => "--slope",
        "odometry" => "--odometry",
        "start" => "`start` in the file of rooms",
        other => other,
    }
}
