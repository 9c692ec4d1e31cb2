//! The ending of an output's name against what is written into it.

use crate::error::Error;
use std::path::Path;

/// What a task writes into a file.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Written {
    Recording,
    /// Rows as CSV.
    Csv,
    /// Rows as CSV, or as Parquet by the name.
    Table,
    /// Rows as lines of JSON.
    Lines,
    /// One JSON value.
    Json,
    Drawing,
    Text,
    C,
    Rust,
}

impl Written {
    const fn shown(self) -> &'static str {
        match self {
            Self::Recording => "a recording",
            Self::Csv | Self::Table => "CSV",
            Self::Lines | Self::Json => "JSON",
            Self::Drawing => "SVG",
            Self::Text => "text",
            Self::C => "C",
            Self::Rust => "Rust",
        }
    }

    /// Whether a file with this ending holds something else.
    fn is_other(self, ending: &str) -> bool {
        let own: &[&str] = match self {
            Self::Recording => &["fewb"],
            Self::Csv => &["csv"],
            Self::Table => &["csv", "parquet"],
            Self::Lines | Self::Json => &["json", "jsonl", "ndjson"],
            Self::Drawing => &["svg"],
            Self::Text => &[],
            Self::C => &["h", "c"],
            Self::Rust => &["rs"],
        };
        ENDINGS.contains(&ending) && !own.contains(&ending)
    }

    fn mend(self, ending: &str) -> &'static str {
        match (ending, self) {
            ("gz" | "zst" | "bz2" | "xz" | "zip", _) => {
                "leave out --output and pipe what is written to the program that compresses"
            }
            (_, Self::Recording) => "name it `.fewb`, and `fewbits unpack` makes a table of it",
            ("fewb", Self::Csv | Self::Table) => {
                "leave out --output and add `| fewbits pack - -o FILE.fewb`, or name it `.csv`"
            }
            ("json" | "jsonl" | "ndjson", Self::Table) => "name it `.csv`, or use `fewbits cat --json`",
            ("json" | "jsonl" | "ndjson", Self::Csv) => "name it `.csv`, or add --json if the task has it",
            (_, Self::Table) => "name it `.csv` or `.parquet`",
            (_, Self::Csv) => "name it `.csv`",
            ("csv", Self::Lines) => "name it `.jsonl`, or leave out --json",
            (_, Self::Lines) => "name it `.jsonl`",
            (_, Self::Json) => "name it `.json`",
            (_, Self::Drawing) => "name it `.svg`",
            ("json", _) => "name it `.txt`, or add --json",
            (_, Self::Text) => "name it `.txt`",
            (_, Self::C) => "name it `.h`",
            (_, Self::Rust) => "name it `.rs`",
        }
    }
}

/// Endings that say what a file holds.
const ENDINGS: [&str; 40] = [
    "fewb", "csv", "tsv", "tab", "json", "jsonl", "ndjson", "parquet", "arrow", "arrows", "feather", "ipc", "avro",
    "orc", "xlsx", "xls", "ods", "h5", "hdf5", "nc", "mat", "npy", "npz", "db", "sqlite", "svg", "png", "jpg", "jpeg",
    "pdf", "h", "c", "rs", "toml", "gz", "zst", "bz2", "xz", "zip", "pickle",
];

/// The ending of a name in small letters.
pub(crate) fn ending(path: &Path) -> Option<String> {
    Some(path.extension()?.to_string_lossy().to_lowercase())
}

/// Refuses a name whose ending is that of something else than what is written.
pub(crate) fn check(path: &Path, written: Written) -> Result<(), Error> {
    match ending(path) {
        Some(ending) if written.is_other(&ending) => Err(Error::Ending {
            output: path.display().to_string(),
            mend: written.mend(&ending),
            written: written.shown(),
            ending,
        }),
        _ => Ok(()),
    }
}
