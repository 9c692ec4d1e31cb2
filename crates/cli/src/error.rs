//! What the command refuses. Every message says where and what to do.

use std::io;

/// Errors of the command.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum Error {
    /// A file could not be opened, read or written.
    #[error("{file}: cannot {action}")]
    File {
        file: String,
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
    /// A table could not be read.
    #[error("{file}")]
    Table {
        file: String,
        #[source]
        source: csv::Error,
    },
    /// A table without columns or rows.
    #[error("{file}: no {what}: the first line names the columns, rows follow")]
    Empty { file: String, what: &'static str },
    /// A column was asked for that the table does not have.
    #[error("{file}: no column `{column}`: there are {existing}")]
    NoColumn {
        file: String,
        column: String,
        existing: String,
    },
    /// A cell is no number.
    #[error("{file}: row {row}, column `{column}`: `{cell}` {problem}: {mend}")]
    Cell {
        file: String,
        row: u64,
        column: String,
        cell: String,
        problem: &'static str,
        mend: &'static str,
    },
    /// An option could not be understood.
    #[error("{option}: `{value}` is not understood: expected {expected}")]
    Option {
        option: &'static str,
        value: String,
        expected: &'static str,
    },
    /// Binary data would go to a terminal.
    #[error("standard output is a terminal: name a file with --output, or redirect")]
    Terminal,
    /// The two files of a comparison do not have the same rows.
    #[error("{file}: {problem}")]
    Mismatch { file: String, problem: String },
    /// A socket could not be used.
    #[error("{address}: cannot {action}")]
    Socket {
        address: String,
        action: &'static str,
        #[source]
        source: io::Error,
    },
    /// JSON could not be written.
    #[error("cannot write JSON")]
    Json(#[from] serde_json::Error),
}

impl Error {
    pub(crate) fn file(file: &str, action: &'static str) -> impl Fn(io::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| Self::File {
            file: file.clone(),
            action,
            source,
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
        move |source| Self::Table {
            file: file.clone(),
            source,
        }
    }

    /// Whether nobody reads the output any more.
    pub(crate) fn is_closed_pipe(&self) -> bool {
        let kind = match self {
            Self::File { source, .. } => source.kind(),
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
