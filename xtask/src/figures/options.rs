//! Options of the command line.

use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Options of `cargo xtask figures`.
#[derive(Debug, Clone, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Options {
    /// What to do instead of making figures.
    #[command(subcommand)]
    pub action: Option<Action>,
    /// Ids or globs of the figures to make, such as `dymbo-fig5` or `mi-*`; all without any.
    pub ids: Vec<String>,
    /// List the figures and make nothing; `describe ID` has their parameters and columns.
    #[arg(long)]
    pub list: bool,
    /// Set a parameter of the chosen figures; lists are separated by commas. Repeatable.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Number of Monte-Carlo trials, for figures that have a parameter `trials`.
    #[arg(long)]
    pub trials: Option<u64>,
    /// Root of all randomness.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of threads; all cores by default. The output does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub threads: Option<u64>,
    /// Directory for the output, made if missing; relative to the workspace.
    #[arg(long, default_value = "target/figures")]
    pub out: PathBuf,
    /// Make all chosen figures anew, also those whose parameters and program are unchanged since they were made.
    #[arg(long)]
    pub force: bool,
    /// Write no SVG.
    #[arg(long)]
    pub no_plots: bool,
    /// Fewer trials; claims that need the full count are skipped.
    #[arg(long)]
    pub quick: bool,
    /// But none that match this id or glob. Repeatable.
    #[arg(long, value_name = "ID")]
    pub except: Vec<String>,
    /// Of these figures only those that failed in the output directory, or whose claims did.
    #[arg(long)]
    pub failed: bool,
    /// Every N-th of these figures, beginning with the I-th, to share the work between machines: `1/3`, `2/3`, `3/3`, then `merge`.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

/// What to do instead of making figures.
#[derive(Debug, Clone, Subcommand)]
pub enum Action {
    /// Say what figures take and give: parameters with ranges, tables with columns and units.
    Describe {
        /// Ids or globs.
        #[arg(required = true)]
        ids: Vec<String>,
    },
    /// Gather the output directories of several shards in one, with one gallery and one verdict.
    Merge {
        /// Directories to take figures from; relative to the workspace.
        #[arg(required = true)]
        from: Vec<PathBuf>,
        /// Directory for the gathered output, made if missing; relative to the workspace.
        #[arg(long, default_value = "target/figures")]
        out: PathBuf,
        /// Print the summary as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write the column of `docs/errata.md` that names the figures and tests which show each erratum. Figures that the directory does
    /// not have keep their place.
    Errata {
        /// Directory with figures, of quick ones at least; relative to the workspace.
        #[arg(default_value = "target/figures")]
        from: PathBuf,
        /// Write nothing and fail if the column is not up to date.
        #[arg(long)]
        check: bool,
    },
    /// Print the table of expected times with what the figures of an output directory took.
    Times {
        /// Directory with figures; relative to the workspace.
        #[arg(default_value = "target/figures")]
        from: PathBuf,
    },
}

/// A path of the command line: relative ones are relative to the workspace, wherever the command is given.
pub(super) fn in_workspace(path: &Path) -> PathBuf {
    let manifest =
        std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| env!("CARGO_MANIFEST_DIR").into(), PathBuf::from);
    match manifest.parent() {
        Some(workspace) if path.is_relative() && workspace.is_dir() => workspace.join(path),
        _ => path.to_owned(),
    }
}
