//! `cargo xtask figures`: every figure and table, and whether its claims hold.

mod describe;
mod gallery;
mod options;
mod produce;
mod progress;
#[cfg_attr(not(feature = "mpi"), path = "one_rank.rs")]
mod ranks;
mod record;
mod reuse;
mod run;
mod select;
mod summary;
#[cfg(test)]
mod tests;
mod times;
mod write;

pub use options::{Action, Options};

use crate::{Error, errata, files, tidy};
use options::in_workspace;
use record::Record;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

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

/// Makes the chosen figures. With feature `mpi` under `mpirun`, the ranks share them; rank 0 alone reads and writes `--out` and prints.
///
/// # Errors
/// If an option is refused or the output directory cannot be written. Nothing is written before all options are accepted.
pub fn run(options: &Options) -> Result<Ending, Error> {
    let ranks = ranks::Ranks::start();
    if !ranks.is_first() {
        return run::work(&ranks, options);
    }
    match &options.action {
        Some(Action::Describe { ids }) => {
            let pages: Vec<_> = select::figures(ids)?.into_iter().map(describe::one).collect();
            print(&pages.join("\n"));
            Ok(Ending::Good)
        }
        Some(Action::Merge { from, out, json }) => merge(from, &in_workspace(out), *json),
        Some(Action::Errata { from, check }) => errata(&in_workspace(from), *check),
        Some(Action::Times { from }) => {
            print(&times::table(&Record::read_all(&in_workspace(from))?));
            Ok(Ending::Good)
        }
        None => make(options, &ranks),
    }
}

fn make(options: &Options, ranks: &ranks::Ranks) -> Result<Ending, Error> {
    let folder = in_workspace(&options.out);
    let mut chosen = select::figures(&options.ids)?;
    if !options.except.is_empty() {
        let left_out: Vec<_> = select::figures(&options.except)?
            .iter()
            .map(|figure| figure.about().id)
            .collect();
        chosen.retain(|figure| !left_out.contains(&figure.about().id));
    }
    if options.failed {
        let records = Record::read_all(&folder)?;
        chosen.retain(|figure| records.get(figure.about().id).is_some_and(|r| !r.good()));
    }
    if let Some(text) = &options.shard {
        chosen = select::shard(chosen, text)?;
    }
    if options.list {
        print(&describe::list(&chosen, options.quick));
        return Ok(Ending::Good);
    }
    let jobs = select::configure(&chosen, options)?;
    run::run(&jobs, &write::Directory::create(&folder)?, options, ranks)
}

/// Copies the figures of other directories into one.
fn merge(from: &[PathBuf], out: &Path, json: bool) -> Result<Ending, Error> {
    let out = write::Directory::create(out)?;
    let mut records = Vec::new();
    for folder in from {
        let folder = in_workspace(folder);
        for record in Record::read_all(&folder)?.into_values() {
            if let Some(name) = record.damaged(&folder) {
                let path = folder.join(name);
                return Err(Error(format!("{} is not as it was written: make the figure again", path.display())));
            }
            for name in record.files.iter().chain([&format!("{}.json", record.id)]) {
                let path = folder.join(name);
                let content = std::fs::read(&path).map_err(Error::reading(&path))?;
                out.write(name, &content)?;
            }
            records.push(record);
        }
    }
    let elapsed = Duration::from_secs_f64(records.iter().map(|r| r.wall_time_s).sum());
    write::write_summary(&out, &records, &Record::read_all(out.path())?, elapsed, "")?;
    Ok(ending(&out, json, &records, elapsed))
}

/// Prints the summary and says how a run ended.
fn ending(out: &write::Directory, json: bool, records: &[Record], elapsed: Duration) -> Ending {
    let page = if json { summary::json } else { summary::text };
    print(&page(records, out.path(), elapsed));
    if records.iter().all(Record::good) {
        Ending::Good
    } else {
        Ending::Failed
    }
}

/// Writes the last column of `docs/errata.md` from the claims of a directory, or compares it.
fn errata(from: &Path, check: bool) -> Result<Ending, Error> {
    let records = Record::read_all(from)?;
    let tests = tidy::errata::tests(&in_workspace(Path::new(".")))?;
    let path = in_workspace(Path::new("docs/errata.md"));
    let page = files::read(&path)?;
    let ids = fewbits_experiments::ids();
    let new = errata::written(&page, &tests, |row| {
        let shows = |id: &&&'static str| match records.get(**id) {
            Some(record) => record
                .claims
                .iter()
                .any(|c| errata::cited(&c.statement).any(|cited| cited == row.id)),
            None => row.names(id),
        };
        ids.iter().filter(shows).copied().collect()
    });
    match (new == page, check) {
        (true, _) => Ok(Ending::Good),
        (false, true) => {
            eprintln!("{} is not up to date: `cargo xtask figures errata`", path.display());
            Ok(Ending::Failed)
        }
        (false, false) => {
            files::write(&path, &new)?;
            Ok(Ending::Good)
        }
    }
}

/// Prints a page; a reader that has seen enough and closed the pipe is no error.
fn print(page: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(page.as_bytes()).and_then(|()| out.flush());
}
