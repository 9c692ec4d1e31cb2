//! Files that a task reads and writes, taken from its arguments before it begins.
//!
//! An output that is also an input would destroy it. Files are compared by identity (device and number), so that links and other
//! spellings of a path are found too.

use crate::arguments::{ReceiveOptions, TableOptions, Task};
use crate::design_options::Form;
use crate::error::Error;
use crate::naming::{self, Written};
use crate::{patterns, target};
use fewbits_recipes::names;
use std::fs::{File, Metadata};
use std::path::{Path, PathBuf};

/// Inputs and outputs of a task.
#[derive(Default)]
struct Files {
    /// `-` is standard input.
    reads: Vec<PathBuf>,
    writes: Vec<PathBuf>,
    /// Whether the task may write to standard output.
    prints: bool,
    /// Whether rows come from a socket or a line.
    is_live: bool,
}

/// What distinguishes a file from all others.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Identity {
    #[cfg(unix)]
    Number(u64, u64),
    #[cfg(not(unix))]
    Path(PathBuf),
}

#[cfg(unix)]
fn number(found: &Metadata) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    // What is written to a pipe or a device does not destroy what was read from it.
    found.is_file().then(|| Identity::Number(found.dev(), found.ino()))
}

/// The identity of a file that exists; `None` for pipes and devices.
#[cfg(unix)]
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    number(&std::fs::metadata(path).ok()?)
}

#[cfg(not(unix))]
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    std::fs::metadata(path).ok().filter(Metadata::is_file)?;
    path.canonicalize().ok().map(Identity::Path)
}

/// Properties of a standard stream.
#[cfg(unix)]
fn stream(stream: &impl std::os::fd::AsFd) -> Option<Metadata> {
    File::from(stream.as_fd().try_clone_to_owned().ok()?).metadata().ok()
}

#[cfg(unix)]
fn standard(is_input: bool) -> Option<Identity> {
    let found = if is_input {
        stream(&std::io::stdin())
    } else {
        stream(&std::io::stdout())
    };
    number(&found?)
}

#[cfg(not(unix))]
fn standard(_is_input: bool) -> Option<Identity> {
    None
}

/// Whether an open file is the one that stands at `path` now.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    file.metadata().is_ok_and(|found| number(&found) == identity(path))
}

/// Whether an open file is the one that stands at `path` now. Here an open file cannot be replaced.
#[cfg(not(unix))]
pub(crate) fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

/// Whether a file can be read twice: neither standard input nor a pipe nor a device.
pub(crate) fn is_regular(file: &str) -> bool {
    file != "-" && std::fs::metadata(file).is_ok_and(|found| found.is_file())
}

/// Whether rows from here cannot be read again: a pipe, or standard input that is no file.
fn is_live(file: &Path) -> bool {
    #[cfg(unix)]
    if file == Path::new("-") {
        return !stream(&std::io::stdin()).is_some_and(|found| found.is_file());
    }
    file == Path::new("-") || std::fs::metadata(file).is_ok_and(|found| !found.is_file())
}

impl Files {
    fn reading(file: impl AsRef<Path>) -> Self {
        Self {
            reads: vec![file.as_ref().to_owned()],
            ..Self::default()
        }
    }

    fn reading_all(files: &[String]) -> Self {
        Self {
            reads: files.iter().map(PathBuf::from).collect(),
            ..Self::default()
        }
    }

    fn writing<'a>(mut self, paths: impl IntoIterator<Item = &'a Option<PathBuf>>) -> Self {
        let mut paths = paths.into_iter();
        // The first is the output, which is standard output if it is missing.
        match paths.next() {
            Some(Some(path)) => self.writes.push(path.clone()),
            Some(None) => self.prints = true,
            None => {}
        }
        self.writes.extend(paths.flatten().cloned());
        self
    }

    fn of(task: &Task) -> Self {
        match task {
            Task::Look(options) => Self::reading(&options.table.file).writing([&None]),
            Task::Plan(options) => Self::reading(&options.table.file).writing([&None, &options.plot]),
            Task::Pack(options) => Self::reading(&options.table.file).writing([&options.output]),
            Task::Unpack(options) => Self::reading_all(&options.files).writing([&options.output]),
            Task::Cat(options) => Self::reading_all(&options.files).writing([&options.output]),
            // Without an output recordings are replaced.
            Task::Repack(options) if options.output.is_none() => Self::reading_all(&options.files),
            Task::Repack(options) => Self::reading_all(&options.files).writing([&options.output]),
            Task::Info(options) => Self::reading(&options.file).writing([&None]),
            Task::Verify(options) => {
                let mut files = Self::reading(&options.table.file).writing([&None]);
                files.reads.push(options.packed.clone());
                files
            }
            Task::Bench(options) => Self::reading(&options.table.file).writing([&None]),
            Task::Track(options) => {
                let mut files = Self::reading(&options.table.file).writing([&options.output, &options.plot]);
                files.reads.extend(options.anchors.iter().map(PathBuf::from));
                files.reads.extend(options.settings.clone());
                files
            }
            Task::Fit(options) => {
                let mut files = Self::reading(&options.table.file).writing([&None]);
                files.writes.extend(options.output.clone());
                files
            }
            Task::Leak(options) => {
                let mut files = Self::reading(&options.table.file).writing([&options.output]);
                files.reads.push(options.rooms.clone());
                files
            }
            Task::Ranges(options) => {
                let mut files = Self::reading(&options.table.file).writing([&options.output, &options.plot]);
                files.reads.push(PathBuf::from(&options.anchors));
                files
            }
            Task::Design(options) => {
                let mut files = Self::default().writing([&options.output, &options.plot]);
                files.reads.extend(options.file.iter().map(PathBuf::from));
                files.reads.extend(options.settings.clone());
                files
            }
            Task::Send(options) => {
                let mut files = Self::reading(&options.table.file).writing([&options.output]);
                files.prints &= options.udp.is_none() && options.serial.is_none();
                files
            }
            Task::Receive(ReceiveOptions {
                file,
                udp,
                serial,
                output,
                ..
            }) => {
                let is_live = udp.is_some() || serial.is_some();
                let mut files = Self::reading(file).writing([output]);
                if is_live {
                    files.reads.clear();
                }
                Self { is_live, ..files }
            }
            Task::Generate(_) | Task::Centre(_) | Task::Check(_) | Task::Sensor(_) => Self::default(),
        }
    }

    /// Refuses outputs that are inputs or each other.
    fn check(&self) -> Result<(), Error> {
        let input = |path: &PathBuf| match path == Path::new("-") {
            true => ("standard input".to_owned(), standard(true)),
            false => (path.display().to_string(), identity(path)),
        };
        let mut taken: Vec<(String, Option<Identity>)> = self.reads.iter().map(input).collect();
        let mut outputs: Vec<(String, Option<Identity>)> = Vec::new();
        if self.prints {
            outputs.push((target::STANDARD_OUTPUT.to_owned(), standard(false)));
        }
        for path in &self.writes {
            let name = path.display().to_string();
            // Two outputs that do not exist yet have no identity, but a path.
            if outputs.iter().any(|(known, _)| *known == name) {
                return Err(Error::SameFile {
                    output: name.clone(),
                    other: name,
                });
            }
            outputs.push((name, identity(path)));
        }
        for (name, found) in outputs {
            if let Some((other, _)) = taken.iter().find(|(_, known)| found.is_some() && *known == found) {
                let other = other.clone();
                return Err(Error::SameFile { output: name, other });
            }
            taken.push((name, found));
        }
        Ok(())
    }
}

/// Refuses outputs whose names end as those of something else.
fn check_names(task: &Task) -> Result<(), Error> {
    let rows = |json: bool, written| if json { Written::Lines } else { written };
    let (output, written, plot) = match task {
        // What is continued has its name.
        Task::Pack(options) if options.append => return Ok(()),
        Task::Pack(options) => (&options.output, Written::Recording, &None),
        Task::Repack(options) => (&options.output, Written::Recording, &None),
        Task::Send(options) => (&options.output, Written::Recording, &None),
        Task::Unpack(options) => (&options.output, Written::Table, &None),
        Task::Cat(options) if options.every.is_some() => (&options.output, rows(options.json, Written::Csv), &None),
        Task::Cat(options) => (&options.output, rows(options.json, Written::Table), &None),
        Task::Receive(options) if options.format.is_some() || options.sensor.is_some() => {
            (&options.output, Written::Csv, &None)
        }
        Task::Receive(options) => (&options.output, Written::Table, &None),
        Task::Track(options) => (&options.output, rows(options.json, Written::Csv), &options.plot),
        Task::Ranges(options) => (&options.output, rows(options.json, Written::Csv), &options.plot),
        Task::Fit(options) => (&options.output, Written::Json, &None),
        Task::Leak(options) => (&options.output, rows(options.json, Written::Csv), &None),
        Task::Plan(options) => (&None, Written::Csv, &options.plot),
        Task::Design(options) => {
            let written = match options.form {
                _ if options.json => Written::Json,
                Form::Json => Written::Json,
                Form::Table => Written::Text,
                Form::C => Written::C,
                Form::Rust => Written::Rust,
            };
            (&options.output, written, &options.plot)
        }
        _ => return Ok(()),
    };
    for (path, written) in [(output, written), (plot, Written::Drawing)] {
        if let Some(path) = path {
            naming::check(path, written)?;
        }
    }
    Ok(())
}

/// Splits lists of names, of which clap hands on the whole text.
fn split(lists: &mut Vec<String>, option: &'static str) -> Result<(), Error> {
    let mut names = Vec::new();
    for text in lists.iter() {
        let list = names::list(text);
        names.extend(
            list.map_err(|_| {
                Error::option(option, text, "names with commas between them, quoted if they have commas")
            })?,
        );
    }
    *lists = names;
    Ok(())
}

fn table(task: &mut Task) -> Option<&mut TableOptions> {
    match task {
        Task::Plan(options) => Some(&mut options.table),
        Task::Pack(options) => Some(&mut options.table),
        Task::Verify(options) => Some(&mut options.table),
        Task::Look(options) => Some(&mut options.table),
        Task::Bench(options) => Some(&mut options.table),
        Task::Track(options) => Some(&mut options.table),
        Task::Ranges(options) => Some(&mut options.table),
        Task::Fit(options) => Some(&mut options.table),
        Task::Leak(options) => Some(&mut options.table),
        Task::Send(options) => Some(&mut options.table),
        _ => None,
    }
}

/// Checks the files of a task, and completes its arguments.
pub(crate) fn prepare(task: &mut Task) -> Result<(), Error> {
    if let Some(table) = table(task) {
        split(&mut table.columns, "--columns")?;
    }
    if let Task::Cat(options) = task {
        split(&mut options.columns, "--columns")?;
    }
    if let Some(files) = match task {
        Task::Cat(options) => Some(&mut options.files),
        Task::Unpack(options) => Some(&mut options.files),
        Task::Repack(options) => Some(&mut options.files),
        _ => None,
    } {
        // The given order decides which of two recordings has its columns' order; wildcards are sorted.
        let names: Vec<&str> = files.iter().map(String::as_str).collect();
        *files = patterns::expanded_in_order(&names)?;
    }
    // Several files are compared when their names are known.
    if patterns::are_several(task) {
        return Ok(());
    }
    let files = Files::of(task);
    files.check()?;
    check_names(task)?;
    target::set_live(files.is_live || files.reads.iter().any(|file| is_live(file)));
    Ok(())
}
