//! Why figures could not be made.

use std::path::PathBuf;
use thiserror::Error;

/// Why figures could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// No figure has that id, or the glob matches none.
    #[error("no figure matches `{pattern}`; {advice}")]
    UnknownFigure {
        /// What was asked for.
        pattern: String,
        /// The ids that are nearest, or all.
        advice: String,
    },
    /// Not a glob.
    #[error("`{pattern}` is no valid pattern: {reason}")]
    BadPattern {
        /// What was asked for.
        pattern: String,
        /// Why it is refused.
        reason: String,
    },
    /// Not of the form `name=value`.
    #[error("--set {text}: expected NAME=VALUE")]
    BadSetting {
        /// What was given.
        text: String,
    },
    /// A file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A directory could not be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Not of the form `i/n`.
    #[error("--shard {text}: expected I/N with I from 1 to N, such as 2/3")]
    BadShard {
        /// What was given.
        text: String,
    },
    /// A plot could not be drawn.
    #[error("cannot draw {id}: {reason}")]
    Draw {
        /// Which figure.
        id: String,
        /// Why.
        reason: String,
    },
    /// The gallery cannot be served.
    #[error("cannot serve the gallery: {0}")]
    Serve(Box<dyn std::error::Error + Send + Sync>),
    /// The thread pool could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The sources could not be read.
    #[error(transparent)]
    Sources(#[from] crate::tidy::Error),
    /// A setting was refused.
    #[error(transparent)]
    Setting(fewbits_experiments::Error),
}
