//! Why a task could not be done.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a task could not be done.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The workspace's manifests could not be read.
    #[error(transparent)]
    Metadata(#[from] cargo_metadata::Error),
    /// A file or folder could not be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file or folder could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// cargo could not be started.
    #[error("cannot run cargo: {0}")]
    Cargo(std::io::Error),
    /// No crate has that name, or it has nothing for the task.
    #[error("no crate `{name}` for this task; these are: {valid}")]
    UnknownCrate {
        /// What was asked for.
        name: String,
        /// What can be asked for.
        valid: String,
    },
    /// Benchmarks ran and their table was not understood: divan prints no other format.
    #[error("the benchmarks of crate `{name}` ran, but their table was not understood: {line}")]
    Unread {
        /// The crate.
        name: String,
        /// What was met.
        line: String,
    },
    /// rustdoc failed; its own messages were printed.
    #[error("rustdoc failed")]
    Rustdoc,
    /// rustdoc's description of a crate could not be read: `public-api` must fit the toolchain.
    #[cfg(feature = "api")]
    #[error("{path}: {source}; the version of the crate `public-api` must fit the toolchain's")]
    Description {
        /// The description.
        path: PathBuf,
        /// What went wrong.
        source: Box<public_api::Error>,
    },
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
    /// Not of the form `i/n`.
    #[error("--shard {text}: expected I/N with I from 1 to N, such as 2/3")]
    BadShard {
        /// What was given.
        text: String,
    },
    /// A setting was refused.
    #[error(transparent)]
    Setting(fewbits_experiments::Error),
    /// A file of a figure is absent, or not as its record says.
    #[error("{path} is not as it was written: make the figure again")]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// A plot without panels, or with one in which nothing is seen.
    #[error("the plot shows nothing in its panel `{title}`")]
    Blank {
        /// The panel's title.
        title: String,
    },
    /// A plot could not be drawn.
    #[error(transparent)]
    Draw(#[from] fewbits_plot::Error),
    /// The thread pool could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

impl Error {
    /// Refuses the first name that is not among the valid ones.
    pub(crate) fn check_crates(names: &[String], valid: &[&str]) -> Result<(), Self> {
        match names.iter().find(|name| !valid.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => Err(Self::UnknownCrate {
                name: name.clone(),
                valid: valid.join(", "),
            }),
        }
    }

    pub(crate) fn reading(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Read {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn writing(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Write {
            path: path.to_owned(),
            source,
        }
    }
}
