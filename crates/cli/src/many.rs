//! Several files for one task: `pack`, `track` and `verify` of many tables, each with a file of its own in a folder.
//!
//! Files are worked on in parallel, each with one line of summary; one that fails does not stop the others. A manifest in the folder
//! names the files that are done: after a kill the same command does the others, and what is done keeps its bytes. `--shard 2/3` takes
//! every third file, so that machines share the work.

use crate::Ending;
use crate::arguments::{ManyOptions, PackOptions, RangesOptions, TrackOptions, VerifyOptions};
use crate::error::Error;
use crate::files::{identity, is_regular};
use crate::manifest::Manifest;
use crate::patterns::expanded_in_order;
use crate::say::{collect, say};
use crate::shard::Shard;
use std::collections::HashMap;
use std::error::Error as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A file of several, and where its result goes.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Job {
    file: String,
    output: PathBuf,
}

/// The names of all files, sorted, so that several machines agree on them.
fn expanded(names: &[&str]) -> Result<Vec<String>, Error> {
    let mut files = expanded_in_order(names)?;
    files.sort();
    Ok(files)
}

/// The name of a table without what says that it is one.
fn stem(file: &str) -> String {
    let name = Path::new(file)
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let packed = [".gz", ".zst"].iter().find_map(|end| name.strip_suffix(end));
    let name = packed.map_or(name.clone(), str::to_owned);
    match name.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem.to_owned(),
        _ => name,
    }
}

/// The share of the files that this command works on.
fn jobs(names: &[&str], shard: Option<Shard>, folder: &Path, extension: &str) -> Result<Vec<Job>, Error> {
    let files = expanded(names)?;
    if let Some(file) = files
        .iter()
        .find(|file| *file == "-" || (Path::new(file).exists() && !is_regular(file)))
    {
        return Err(Error::content(file, "among several files each is a file: take this one alone"));
    }
    let (mut outputs, mut jobs) = (HashMap::new(), Vec::with_capacity(files.len()));
    let inputs: HashMap<_, _> = files
        .iter()
        .filter_map(|file| Some((identity(Path::new(file))?, file)))
        .collect();
    for file in &files {
        let output = folder.join(stem(file) + extension);
        if let Some(first) = outputs.insert(output.clone(), file) {
            return Err(Error::SameOutput {
                output: output.display().to_string(),
                first: first.clone(),
                second: file.clone(),
            });
        }
        if let Some(other) = identity(&output).and_then(|found| inputs.get(&found)) {
            return Err(Error::SameFile {
                output: output.display().to_string(),
                other: (*other).clone(),
            });
        }
        jobs.push(Job {
            file: file.clone(),
            output,
        });
    }
    if let Some(Shard { index, count }) = shard {
        jobs = jobs.into_iter().skip(index).step_by(count).collect();
    }
    Ok(jobs)
}

/// The error with its causes in one line.
pub(crate) fn described(error: &Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    text
}

/// How one file ended.
enum Outcome {
    Good,
    /// A bound is violated, or a part is damaged.
    Failed,
    Refused,
    /// It was done before.
    Kept,
}

/// Works on all files. `keep` says whether one is done already, `done` is called after each that is.
fn run_all(
    jobs: &[Job],
    many: &ManyOptions,
    keep: impl Fn(&Job) -> bool + Sync,
    work: impl Fn(&Job) -> Result<Ending, Error> + Sync,
    done: impl Fn(&Job) + Sync,
) -> Result<Ending, Error> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = many.jobs.map_or(cores, usize::from).min(jobs.len().max(1));
    let (next, counts) = (AtomicUsize::new(0), Mutex::new([0_usize; 4]));
    let one = |job: &Job| {
        if keep(job) {
            return Outcome::Kept;
        }
        let (ended, lines) = collect(|| work(job));
        let (outcome, line) = match ended {
            Ok(Ending::Good) => (Outcome::Good, lines.join("; ")),
            Ok(Ending::Failed | Ending::Refused) => (Outcome::Failed, lines.join("; ")),
            Err(error) => (Outcome::Refused, format!("error: {}", described(&error))),
        };
        if matches!(outcome, Outcome::Good) {
            done(job);
        }
        say!("{}: {line}", job.file);
        outcome
    };
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let index = match one(job) {
                        Outcome::Good => 0,
                        Outcome::Failed => 1,
                        Outcome::Refused => 2,
                        Outcome::Kept => 3,
                    };
                    counts.lock().unwrap_or_else(PoisonError::into_inner)[index] += 1;
                }
            });
        }
    });
    let [good, failed, refused, kept] = *counts.lock().unwrap_or_else(PoisonError::into_inner);
    let mut summary = format!("{good} of {} files done", jobs.len());
    for (count, what) in [(kept, "done before"), (failed, "failed"), (refused, "refused")] {
        if count > 0 {
            summary += &format!(", {count} {what}");
        }
    }
    say!("{summary}");
    Ok(match (failed, refused) {
        (_, 1..) => Ending::Refused,
        (1.., 0) => Ending::Failed,
        (0, 0) => Ending::Good,
    })
}

fn names<'a>(first: &'a str, more: &'a [String]) -> Vec<&'a str> {
    std::iter::once(first).chain(more.iter().map(String::as_str)).collect()
}

fn folder(output: Option<&PathBuf>) -> Result<&PathBuf, Error> {
    let folder = output.ok_or(Error::Needed {
        option: "--output FOLDER",
        reason: "each of several files has an output of its own",
    })?;
    std::fs::create_dir_all(folder).map_err(Error::io(&folder.display().to_string(), "create the folder"))?;
    Ok(folder)
}

/// Works on files whose outputs stand in a folder with a manifest.
fn run_with_manifest(
    jobs: &[Job],
    many: &ManyOptions,
    (names, folder): (&[&str], &Path),
    task: &str,
    work: impl Fn(&Job) -> Result<Ending, Error> + Sync,
) -> Result<Ending, Error> {
    let manifest = Manifest::open(folder, task, many.shard, names)?;
    let keep = |job: &Job| manifest.has(&job.file, &job.output);
    let ending = run_all(jobs, many, keep, work, |job| manifest.add(&job.file, &job.output))?;
    manifest.finish()?;
    Ok(ending)
}

/// Packs several files.
pub(crate) fn pack(options: &PackOptions) -> Result<Ending, Error> {
    if options.append {
        return Err(Error::content("--append", "one recording is continued with one table at a time"));
    }
    let folder = folder(options.output.as_ref())?;
    let many = &options.many;
    let names = names(&options.table.file, &many.more);
    let jobs = jobs(&names, many.shard, folder, ".fewb")?;
    run_with_manifest(&jobs, many, (&names, folder), "pack", |job| {
        let mut one = options.clone();
        one.table.file.clone_from(&job.file);
        one.output = Some(job.output.clone());
        crate::pack::run(&one)
    })
}

/// Tracks several files.
pub(crate) fn track(options: &TrackOptions) -> Result<Ending, Error> {
    if options.plot.is_some() {
        return Err(Error::content("--plot", "several files have no picture: track one with --plot"));
    }
    let folder = folder(options.output.as_ref())?;
    let many = &options.many;
    let extension = if options.json { ".track.jsonl" } else { ".track.csv" };
    let names = names(&options.table.file, &many.more);
    let jobs = jobs(&names, many.shard, folder, extension)?;
    run_with_manifest(&jobs, many, (&names, folder), "track", |job| {
        let mut one = options.clone();
        one.table.file.clone_from(&job.file);
        one.output = Some(job.output.clone());
        crate::track::run(&one)
    })
}

/// Finds the places of several files.
pub(crate) fn ranges(options: &RangesOptions) -> Result<Ending, Error> {
    if options.plot.is_some() {
        return Err(Error::content("--plot", "several files have no picture: do one with --plot"));
    }
    let folder = folder(options.output.as_ref())?;
    let many = &options.many;
    let extension = if options.json { ".ranges.jsonl" } else { ".ranges.csv" };
    let names = names(&options.table.file, &many.more);
    let jobs = jobs(&names, many.shard, folder, extension)?;
    run_with_manifest(&jobs, many, (&names, folder), "ranges", |job| {
        let mut one = options.clone();
        one.table.file.clone_from(&job.file);
        one.output = Some(job.output.clone());
        crate::track::ranges(&one)
    })
}

/// Verifies several files against the recordings of a folder, which is named last.
pub(crate) fn verify(options: &VerifyOptions) -> Result<Ending, Error> {
    let packed = options.packed.to_string_lossy();
    let mut all = names(&options.table.file, &options.many.more);
    all.insert(1, &packed);
    let Some(folder) = all.pop() else {
        return Ok(Ending::Good);
    };
    if !Path::new(folder).is_dir() {
        return Err(Error::content(folder, "behind several tables stands the folder of their recordings"));
    }
    let jobs = jobs(&all, options.many.shard, Path::new(folder), ".fewb")?;
    run_all(
        &jobs,
        &options.many,
        |_| false,
        |job| {
            let mut one = options.clone();
            one.table.file.clone_from(&job.file);
            one.packed.clone_from(&job.output);
            crate::verify::run(&one)
        },
        |_| {},
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_without_what_says_that_they_are_tables() {
        for (file, expected) in [
            ("data/a.csv", "a"),
            ("a.b.csv.gz", "a.b"),
            ("a", "a"),
            (".hidden", ".hidden"),
            ("x.csv.zst", "x"),
        ] {
            assert_eq!(stem(file), expected);
        }
    }

    #[test]
    fn shards_are_parsed() {
        assert_eq!("2/3".parse(), Ok(Shard { index: 1, count: 3 }));
        for text in ["0/3", "4/3", "3", "a/b", "1/0"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
