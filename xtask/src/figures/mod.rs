//! `cargo xtask figures`: every figure and table, and whether its claims hold.

mod describe;
mod draw;
mod gallery;
mod progress;
mod scale;
mod select;
mod summary;
mod write;

pub use draw::to_svg;

use clap::{Args, Subcommand};
use fewbits_experiments::{AnyFigure, Context, Outcome};
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use thiserror::Error;

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
    /// Directory for the output, made if missing.
    #[arg(long, default_value = "target/figures")]
    pub out: PathBuf,
    /// Write no SVG.
    #[arg(long)]
    pub no_plots: bool,
    /// Fewer trials; claims that need the full count are skipped.
    #[arg(long)]
    pub quick: bool,
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
}

/// Why figures could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// No figure has that id, or the glob matches none.
    #[error("no figure matches `{pattern}`; the figures are: {valid}")]
    UnknownFigure {
        /// What was asked for.
        pattern: String,
        /// All ids.
        valid: String,
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
    /// A plot could not be drawn.
    #[error("cannot draw {id}: {reason}")]
    Draw {
        /// Which figure.
        id: String,
        /// Why.
        reason: String,
    },
    /// The thread pool could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A setting was refused.
    #[error(transparent)]
    Setting(fewbits_experiments::Error),
}

/// A figure that was run: its outcome or why there is none, and how long it took.
pub(crate) struct Finished {
    figure: &'static dyn AnyFigure,
    result: Result<Outcome, String>,
    elapsed: Duration,
}

/// Makes the chosen figures; `Ok(false)` if a claim or a figure failed.
///
/// # Errors
/// If an option is refused or output cannot be written. Nothing is written before all options are accepted.
pub fn run(options: &Options) -> Result<bool, Error> {
    if let Some(Action::Describe { ids }) = &options.action {
        let pages: Vec<_> = select::figures(ids)?.into_iter().map(describe::one).collect();
        return Ok(print(&pages.join("\n")));
    }
    let chosen = select::figures(&options.ids)?;
    if options.list {
        return Ok(print(&describe::list(&chosen)));
    }
    let jobs = select::configure(&chosen, options)?;
    let out = write::Directory::create(&options.out)?;
    let mut builder = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = options.threads {
        builder = builder.num_threads(threads as usize);
    }
    let pool = builder.build()?;
    let started = Instant::now();
    let progress = progress::Bars::new(jobs.len() as u64);

    let make = |job: &select::Job| -> Result<Finished, Error> {
        let (figure, began) = (job.figure, Instant::now());
        let bar = progress.start(figure.about().id);
        let report = |trials: u64| bar.advance(trials);
        let context = Context {
            seed: options.seed,
            progress: Some(&report),
            cancel: None,
        };
        let result = pool.install(|| figure.produce(&job.parameters, &context));
        let elapsed = began.elapsed();
        if let Ok(outcome) = &result {
            write::figure(&out, figure.about(), outcome, elapsed, options)?;
        }
        bar.finish();
        Ok(Finished {
            figure,
            result: result.map_err(|error| error.to_string()),
            elapsed,
        })
    };
    // Figures that measure time run alone, after all others.
    let (alone, shared): (Vec<_>, Vec<_>) = jobs.iter().partition(|job| job.figure.measures_time());
    let mut finished = side_by_side(&shared, pool.current_num_threads(), make)?;
    for job in alone {
        finished.push(make(job)?);
    }
    progress.clear();
    gallery::write(&out)?;
    Ok(summary::print(&finished, &out, started.elapsed()))
}

/// Prints a page; a reader that has seen enough and closed the pipe is no error.
fn print(page: &str) -> bool {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(page.as_bytes()).and_then(|()| out.flush());
    true
}

/// Runs jobs on up to `workers` threads; results in job order.
fn side_by_side(
    jobs: &[&select::Job],
    workers: usize,
    make: impl Fn(&select::Job) -> Result<Finished, Error> + Sync,
) -> Result<Vec<Finished>, Error> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<Finished, Error>)>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..workers.min(jobs.len()) {
            scope.spawn(|| {
                while let Some((index, job)) = {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    jobs.get(index).map(|job| (index, job))
                } {
                    let result = make(job);
                    done.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push((index, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}
