//! `cargo xtask figures`: every figure and table, and whether its claims hold.

mod describe;
mod draw;
mod gallery;
mod progress;
mod record;
mod select;
mod summary;
mod write;

pub use draw::to_svg;

use clap::{Args, Subcommand};
use fewbits_experiments::{Context, Outcome};
use record::Record;
use std::any::Any;
use std::collections::BTreeSet;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
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
        /// Directories to take figures from.
        #[arg(required = true)]
        from: Vec<PathBuf>,
        /// Directory for the gathered output, made if missing.
        #[arg(long, default_value = "target/figures")]
        out: PathBuf,
        /// Print the summary as JSON.
        #[arg(long)]
        json: bool,
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
    /// The thread pool could not be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A setting was refused.
    #[error(transparent)]
    Setting(fewbits_experiments::Error),
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Everything was made and every claim held or was skipped.
    Good,
    /// A claim failed or a figure could not be made.
    Failed,
    /// The user stopped it; what was complete is on disk.
    Interrupted,
}

/// Set by Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);

/// Makes the chosen figures.
///
/// # Errors
/// If an option is refused or the output directory cannot be written. Nothing is written before all options are accepted.
pub fn run(options: &Options) -> Result<Ending, Error> {
    match &options.action {
        Some(Action::Describe { ids }) => {
            let pages: Vec<_> = select::figures(ids)?.into_iter().map(describe::one).collect();
            print(&pages.join("\n"));
            return Ok(Ending::Good);
        }
        Some(Action::Merge { from, out, json }) => return merge(from, out, *json),
        None => {}
    }
    let mut chosen = select::figures(&options.ids)?;
    if !options.except.is_empty() {
        let left_out: Vec<_> = select::figures(&options.except)?
            .iter()
            .map(|figure| figure.about().id)
            .collect();
        chosen.retain(|figure| !left_out.contains(&figure.about().id));
    }
    if options.failed {
        let records = Record::read_all(&options.out)?;
        chosen.retain(|figure| records.get(figure.about().id).is_some_and(|r| !r.good()));
    }
    if let Some(text) = &options.shard {
        chosen = select::shard(chosen, text)?;
    }
    if options.list {
        print(&describe::list(&chosen));
        return Ok(Ending::Good);
    }
    let jobs = select::configure(&chosen, options)?;
    let out = write::Directory::create(&options.out)?;
    let threads = options.threads.unwrap_or(0) as usize;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    // A handler that is there already (a test in this process) is as good.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("stopping: finished figures stay, running ones are given up (once more to stop at once)");
    });
    let started = Instant::now();
    let progress = progress::Bars::new(jobs.len() as u64);

    let make = |job: &select::Job| -> Option<Record> {
        if STOP.load(Ordering::Relaxed) {
            return None;
        }
        let (about, began) = (job.figure.about(), Instant::now());
        let bar = progress.start(about.id);
        let report = |trials: u64| bar.advance(trials);
        let read = |path: &str| std::fs::read_to_string(path);
        let context = Context {
            seed: options.seed,
            progress: Some(&report),
            cancel: Some(&STOP),
            read: Some(&read),
        };
        let result = produce(&pool, job, &context);
        bar.finish();
        if matches!(&result, Err(Failure::Cancelled)) {
            return None;
        }
        let record = Record::new(about, &job.parameters, began.elapsed(), options);
        let written = match &result {
            Ok(outcome) => write::figure(&out, record.clone().with(outcome), Some(outcome), !options.no_plots),
            Err(failure) => write::figure(&out, record.clone().failed(failure.to_string()), None, false),
        };
        Some(written.unwrap_or_else(|error| record.failed(error.to_string())))
    };
    // Figures that measure time run alone, after all others.
    let (alone, shared): (Vec<_>, Vec<_>) = jobs.iter().partition(|job| job.figure.measures_time());
    let mut finished = side_by_side(&shared, pool.current_num_threads(), make);
    finished.extend(alone.into_iter().map(make));
    progress.clear();
    let stopped = finished.iter().filter(|record| record.is_none()).count();
    let records: Vec<Record> = finished.into_iter().flatten().collect();
    let note = if stopped > 0 {
        format!("Stopped by the user: {stopped} of {} figures were not made.", jobs.len())
    } else {
        String::new()
    };
    let ending = report(&out, &records, &note, started.elapsed(), options.json)?;
    Ok(if stopped > 0 { Ending::Interrupted } else { ending })
}

/// Writes the gallery and prints the summary.
fn report(
    out: &write::Directory,
    records: &[Record],
    note: &str,
    elapsed: Duration,
    json: bool,
) -> Result<Ending, Error> {
    let this_run: BTreeSet<String> = records.iter().map(|r| r.id.clone()).collect();
    let mut all = Record::read_all(out.path())?;
    // Also those whose record could not be written.
    all.extend(records.iter().map(|r| (r.id.clone(), r.clone())));
    let page = gallery::page(all.values(), &this_run, note);
    let written = out.write("index.html", page.as_bytes());
    let summary = if json { summary::json } else { summary::text };
    print(&summary(records, out.path(), elapsed));
    if !note.is_empty() {
        eprintln!("{note}");
    }
    written?;
    Ok(if records.iter().all(Record::good) {
        Ending::Good
    } else {
        Ending::Failed
    })
}

/// Copies the figures of other directories into one.
fn merge(from: &[PathBuf], out: &Path, json: bool) -> Result<Ending, Error> {
    let out = write::Directory::create(out)?;
    let mut records = Vec::new();
    for folder in from {
        for record in Record::read_all(folder)?.into_values() {
            for name in record.files.iter().chain([&format!("{}.json", record.id)]) {
                let path = folder.join(name);
                let content = std::fs::read(&path).map_err(|source| Error::Read { path, source })?;
                out.write(name, &content)?;
            }
            records.push(record);
        }
    }
    let elapsed = Duration::from_secs_f64(records.iter().map(|r| r.wall_time_s).sum());
    report(&out, &records, "", elapsed, json)
}

/// Why a figure has no outcome.
#[derive(Debug, Error)]
enum Failure {
    #[error("stopped")]
    Cancelled,
    #[error("{0}")]
    Refused(fewbits_experiments::Error),
    #[error("panicked (please report this): {0}")]
    Panicked(String),
}

/// Runs one figure; a panic in it is its own failure and nobody else's.
fn produce(pool: &rayon::ThreadPool, job: &select::Job, context: &Context<'_>) -> Result<Outcome, Failure> {
    let run = || pool.install(|| job.figure.produce(&job.parameters, context));
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(outcome)) => Ok(outcome),
        Ok(Err(fewbits_experiments::Error::Cancelled)) => Err(Failure::Cancelled),
        Ok(Err(error)) => Err(Failure::Refused(error)),
        Err(payload) => Err(Failure::Panicked(message(payload.as_ref()))),
    }
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
        .to_owned()
}

/// Prints a page; a reader that has seen enough and closed the pipe is no error.
fn print(page: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(page.as_bytes()).and_then(|()| out.flush());
}

/// Runs jobs on up to `workers` threads; results in job order.
fn side_by_side<T: Send>(
    jobs: &[&select::Job],
    workers: usize,
    make: impl Fn(&select::Job) -> Option<T> + Sync,
) -> Vec<Option<T>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Option<T>)>> = Mutex::default();
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

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_experiments::{About, AnyFigure, Fields, Parameter};
    use serde_json::{Map, Value as Json};

    struct Panics;

    impl AnyFigure for Panics {
        fn about(&self) -> About {
            About::of("demo-fig1", "", "")
        }
        fn measures_time(&self) -> bool {
            false
        }
        fn parameters(&self) -> Vec<Parameter> {
            Vec::new()
        }
        fn tables(&self) -> Vec<Fields> {
            Vec::new()
        }
        fn configure(&self, _: &[(String, String)], _: bool) -> Result<Map<String, Json>, fewbits_experiments::Error> {
            Ok(Map::new())
        }
        fn produce(&self, _: &Map<String, Json>, _: &Context<'_>) -> Result<Outcome, fewbits_experiments::Error> {
            panic!("as a figure might")
        }
    }

    #[test]
    fn a_panic_is_the_failure_of_its_own_figure() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let job = select::Job {
            figure: &Panics,
            parameters: Map::new(),
        };
        let failure = produce(&pool, &job, &Context::new(1)).unwrap_err();
        assert!(failure.to_string().contains("as a figure might"));
    }
}
