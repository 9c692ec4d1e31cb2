//! The list of files that are done, in the folder of their outputs: `fewbits-pack.jsonl`, or `fewbits-pack-2-of-3.jsonl` of a share.
//!
//! A file is done if its line has the same options and the same size and time of change of the input, and the output has the size of
//! the line. A line is written after the output has its final name. Lines that a kill cut off are dropped. When all files are through,
//! the list is written anew, sorted by name.

use crate::error::Error;
use crate::shard::Shard;
use crate::target::Target;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::UNIX_EPOCH;

/// A file that is done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Line {
    file: String,
    input_bytes: u64,
    /// Nanoseconds since 1970.
    input_changed: u64,
    output: String,
    output_bytes: u64,
    options: String,
}

/// The list of one run.
pub(crate) struct Manifest {
    path: PathBuf,
    name: String,
    options: String,
    state: Mutex<State>,
    /// Held as long as the run lasts.
    _lock: File,
}

struct State {
    lines: BTreeMap<String, Line>,
    file: File,
    failure: Option<std::io::Error>,
}

/// The words of the command that change results: all but the names of files and how the work is shared.
fn options(names: &[&str]) -> String {
    let (mut kept, mut words) = (vec![env!("CARGO_PKG_VERSION").to_owned()], std::env::args().skip(1));
    while let Some(word) = words.next() {
        let has_value = |option: &str| word.strip_prefix(option).is_some_and(|rest| rest.starts_with('='));
        match word.as_str() {
            "--jobs" | "--shard" | "-o" | "--output" => drop(words.next()),
            _ if ["--jobs", "--shard", "--output"].iter().any(|option| has_value(option)) => {}
            other if names.contains(&other) => {}
            _ => kept.push(word),
        }
    }
    kept.join(" ")
}

impl Manifest {
    /// Reads the list of a run before, if there is one, and goes on with it. `names` are those of the command, with wildcards.
    pub(crate) fn open(folder: &Path, task: &str, shard: Option<Shard>, names: &[&str]) -> Result<Self, Error> {
        let share = shard.map_or(String::new(), |shard| format!("-{}-of-{}", shard.number(), shard.count));
        let path = folder.join(format!("fewbits-{task}{share}.jsonl"));
        let name = path.display().to_string();
        // The lock is a file of its own: the list is replaced at the end.
        let lock_path = folder.join(format!(".fewbits-{task}{share}.lock"));
        let lock = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&lock_path);
        let lock = lock.map_err(Error::io(&name, "lock"))?;
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            return Err(Error::content(&name, "another command is at work on these files"));
        }
        let failed = Error::io(&name, "read");
        let mut file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(&failed)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(&failed)?;
        let text = String::from_utf8_lossy(&bytes);
        if !(text.is_empty() || text.ends_with('\n')) {
            writeln!(file).map_err(Error::io(&name, "write"))?;
        }
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
        Ok(Self {
            options: options(names),
            state: Mutex::new(State {
                lines: lines.map(|line| (line.file.clone(), line)).collect(),
                file,
                failure: None,
            }),
            path,
            name,
            _lock: lock,
        })
    }

    /// The line of a file that is done now; `None` if input or output do not exist.
    fn line(&self, file: &str, output: &Path) -> Option<Line> {
        let input = std::fs::metadata(file).ok()?;
        let changed = input.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        Some(Line {
            file: file.to_owned(),
            input_bytes: input.len(),
            input_changed: u64::try_from(changed.as_nanos()).ok()?,
            output: output.display().to_string(),
            output_bytes: std::fs::metadata(output).ok()?.len(),
            options: self.options.clone(),
        })
    }

    /// Whether a file was done before and nothing has changed since.
    pub(crate) fn has(&self, file: &str, output: &Path) -> bool {
        let now = self.line(file, output);
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        now.is_some() && state.lines.get(file) == now.as_ref()
    }

    /// Notes a file as done.
    pub(crate) fn add(&self, file: &str, output: &Path) {
        let Some(line) = self.line(file, output) else { return };
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let written = serde_json::to_string(&line)
            .map_err(std::io::Error::from)
            .and_then(|text| state.file.write_all((text + "\n").as_bytes()));
        if let Err(error) = written {
            state.failure.get_or_insert(error);
        }
        state.lines.insert(line.file.clone(), line);
    }

    /// Writes the list anew, sorted.
    pub(crate) fn finish(self) -> Result<(), Error> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = state.failure {
            return Err(Error::io(&self.name, "write")(error));
        }
        let mut target = Target::open(Some(&self.path))?;
        for line in state.lines.values() {
            let text = serde_json::to_string(line)? + "\n";
            target
                .write_all(text.as_bytes())
                .map_err(Error::io(&self.name, "write"))?;
        }
        target.finish()
    }
}
