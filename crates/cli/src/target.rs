//! Where a task writes: a file or standard output.
//!
//! A file is written beside its final place and takes its name when it is finished. A task that is refused, fails or is ended by a signal
//! therefore leaves an earlier file as it was, and no part of a new one.
//!
//! Rows of a live source (a pipe, a socket, a serial line) cannot be read again, so they are kept: they are written to the file itself,
//! or, if there is an earlier file, beside it under a name that ends in `.partial`, which is kept if the task fails.

use crate::error::Error;
use crate::interrupt;
use crate::say::say;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Name of standard output in messages.
pub(crate) const STANDARD_OUTPUT: &str = "standard output";
/// Longest part of a name that is repeated in the name of its unfinished file, in bytes. File systems allow 255.
const MAX_NAME: usize = 200;

/// End of the name of an unfinished file.
const UNFINISHED: &str = ".fewbits-new";

/// Whether the task's source is live; set once from the arguments.
static IS_LIVE: AtomicBool = AtomicBool::new(false);

/// States that rows cannot be read again.
pub(crate) fn set_live(is_live: bool) {
    IS_LIVE.store(is_live, Ordering::Relaxed);
}

/// Whether rows cannot be read again.
pub(crate) fn is_live() -> bool {
    IS_LIVE.load(Ordering::Relaxed)
}

/// How an output reaches its final place.
enum Place {
    /// It is there already: standard output, a pipe, a device.
    Direct,
    /// A new file of a live source. It is removed if nothing was written.
    New { path: PathBuf, is_empty: bool },
    /// A file beside the final one.
    Beside {
        temporary: PathBuf,
        path: PathBuf,
        is_kept: bool,
        is_empty: bool,
    },
}

/// Bytes of a text that were written.
#[derive(Default)]
struct Lines {
    all: u64,
    /// Those up to the end of the last whole line.
    whole: u64,
    is_cut: bool,
}

/// An output.
pub(crate) struct Target {
    /// `None` for standard output.
    file: Option<File>,
    place: Place,
    name: String,
    /// Of a text.
    lines: Option<Lines>,
    /// The earlier file, locked: two commands with live sources would each replace what the other has written.
    _earlier: Option<File>,
}

impl Target {
    /// Opens a file, or standard output. A file to which another command writes rows is refused.
    pub(crate) fn open(path: Option<&Path>) -> Result<Self, Error> {
        let Some(path) = path else {
            return Ok(Self {
                file: None,
                place: Place::Direct,
                name: STANDARD_OUTPUT.to_owned(),
                lines: None,
                _earlier: None,
            });
        };
        Self::at(path, true)
    }

    /// As [`open`](Self::open), for a file that this command has locked.
    pub(crate) fn replacing(path: &Path) -> Result<Self, Error> {
        Self::at(path, false)
    }

    fn at(path: &Path, locks: bool) -> Result<Self, Error> {
        let name = path.display().to_string();
        let failed = Error::io(&name, "create");
        // A link stays a link: the file that it names is replaced.
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let earlier = std::fs::metadata(&path).ok();
        let lock = |file: &File| match locks && cfg!(unix) && matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            true => Err(Error::content(&name, "another command writes to it: try again when it has ended")),
            false => Ok(()),
        };
        let mut locked = None;
        let (file, place) = match earlier {
            // A pipe or a device is written to as it is; a folder is refused.
            Some(found) if !found.is_file() => {
                (OpenOptions::new().write(true).open(&path).map_err(&failed)?, Place::Direct)
            }
            None if is_live() => {
                let file = OpenOptions::new()
                    .write(true)
                    .create_new(true)
                    .open(&path)
                    .map_err(&failed)?;
                lock(&file)?;
                (file, Place::New { path, is_empty: true })
            }
            earlier => {
                // What may not be written to is not replaced either.
                let is_kept = is_live();
                if earlier.is_some() {
                    let file = OpenOptions::new().write(true).open(&path).map_err(&failed)?;
                    lock(&file)?;
                    locked = Some(file).filter(|_| is_kept);
                }
                let create = || beside(&path, &name);
                let (file, temporary) = if is_kept { create() } else { interrupt::create(create) }?;
                if is_kept && earlier.as_ref().is_some_and(|earlier| earlier.len() > 0) {
                    // A receiver that starts again after a kill has its earlier rows there.
                    say!(
                        "note: {name} is there: until the end, rows stand in {}, which then replaces it; name another output to keep both",
                        temporary.display()
                    );
                }
                if let Some(earlier) = earlier
                    && let Err(error) = file.set_permissions(earlier.permissions())
                {
                    let _ = std::fs::remove_file(&temporary);
                    interrupt::forget(&temporary);
                    return Err(failed(error));
                }
                let is_empty = true;
                (
                    file,
                    Place::Beside {
                        temporary,
                        path,
                        is_kept,
                        is_empty,
                    },
                )
            }
        };
        Ok(Self {
            file: Some(file),
            place,
            name,
            lines: None,
            _earlier: locked,
        })
    }

    /// As [`open`](Self::open), but refuses to write binary data to a terminal.
    pub(crate) fn open_binary(path: Option<&Path>) -> Result<Self, Error> {
        if path.is_none() && std::io::stdout().is_terminal() {
            return Err(Error::Terminal);
        }
        Self::open(path)
    }

    /// States that lines are written: a full disk leaves whole ones. The end of a line that is cut would be read as another number.
    pub(crate) fn of_lines(mut self) -> Self {
        self.lines = Some(Lines::default());
        self
    }

    /// Takes a line that is not whole out of a file, after an error. Nothing is written behind it.
    fn cut(&mut self) {
        let is_file = matches!(self.place, Place::New { .. } | Place::Beside { .. });
        if let (Some(file), Some(lines), true) = (&self.file, &mut self.lines, is_file) {
            lines.is_cut = file.set_len(lines.whole).is_ok();
        }
    }

    /// The name in messages.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// A handle of a file whose rows cannot be read again.
    pub(crate) fn spare(&self) -> Option<File> {
        let is_kept = matches!(self.place, Place::New { .. } | Place::Beside { is_kept: true, .. });
        self.file.as_ref().filter(|_| is_kept)?.try_clone().ok()
    }

    /// Writes out everything and gives a file its final name.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        self.flush().map_err(Error::io(&self.name, "write"))?;
        let place = std::mem::replace(&mut self.place, Place::Direct);
        if let Place::Beside { temporary, path, .. } = &place {
            // Without this, a power loss after the renaming could leave an empty file in place of the earlier one.
            let done = match &self.file {
                Some(file) => file.sync_all(),
                None => Ok(()),
            };
            let done = done.and_then(|()| std::fs::rename(temporary, path));
            interrupt::forget(temporary);
            if let Err(error) = done {
                self.place = place;
                return Err(Error::io(&self.name, "write")(error));
            }
        }
        Ok(())
    }
}

/// Creates a new file in the folder of `path`.
fn beside(path: &Path, name: &str) -> Result<(File, PathBuf), Error> {
    let whole = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let mut end = whole.len().min(MAX_NAME);
    while !whole.is_char_boundary(end) {
        end -= 1;
    }
    let kept = format!(".{}.", &whole[..end]);
    let process = std::process::id();
    let mut failure = None;
    for attempt in 0..1000 {
        let temporary = match is_live() {
            true => format!("{}{process}-{attempt}.partial", &kept[1..]),
            false => format!("{kept}{process}-{attempt}{UNFINISHED}"),
        };
        let temporary = path.with_file_name(temporary);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            // Another process may have taken it for an abandoned one before it was locked.
            Ok(file) if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) || !temporary.exists() => {}
            Ok(file) => {
                remove_abandoned(&temporary, &kept);
                return Ok((file, temporary));
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => failure = Some(error),
            Err(error) => return Err(Error::io(name, "create a file beside it")(error)),
        }
    }
    let failure = failure.unwrap_or_else(|| std::io::ErrorKind::AlreadyExists.into());
    Err(Error::io(name, "create a file beside it")(failure))
}

/// Unfinished files of each folder, as they were when this command first wrote there: to list a folder for each of many outputs takes
/// longer than to write them.
static FOUND: Mutex<BTreeMap<PathBuf, Vec<String>>> = Mutex::new(BTreeMap::new());

fn unfinished_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    names.filter(|name| name.ends_with(UNFINISHED)).collect()
}

/// Removes unfinished files for the same output whose writers were killed: a writer that lives holds the lock of its file.
fn remove_abandoned(own: &Path, kept: &str) {
    let folder = own.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let mut found = FOUND.lock().unwrap_or_else(PoisonError::into_inner);
    let names = found.entry(folder.to_owned()).or_insert_with(|| unfinished_in(folder));
    for name in names.iter().filter(|name| name.starts_with(kept)) {
        let path = folder.join(name);
        if path != own && is_abandoned(&path) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Whether no living process holds the lock of a file, or it does not exist.
fn is_abandoned(path: &Path) -> bool {
    match File::open(path) {
        Ok(file) => file.try_lock().is_ok(),
        Err(error) => error.kind() == std::io::ErrorKind::NotFound,
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.lines.as_ref().is_some_and(|lines| lines.is_cut) {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        let written = match &mut self.file {
            Some(file) => file.write(bytes),
            None => std::io::stdout().lock().write(bytes),
        };
        if written
            .as_ref()
            .is_err_and(|error| error.kind() != std::io::ErrorKind::Interrupted)
        {
            self.cut();
        }
        let written = written?;
        if let Some(lines) = &mut self.lines {
            if let Some(end) = bytes[..written].iter().rposition(|byte| *byte == b'\n') {
                lines.whole = lines.all + end as u64 + 1;
            }
            lines.all += written as u64;
        }
        if let Place::New { is_empty, .. } | Place::Beside { is_empty, .. } = &mut self.place {
            *is_empty &= written == 0;
        }
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match &mut self.file {
            Some(file) => file.flush(),
            None => std::io::stdout().lock().flush(),
        }
    }
}

/// The task has failed: what was written is removed, or kept if it cannot be read again.
impl Drop for Target {
    fn drop(&mut self) {
        match &self.place {
            Place::New { path, is_empty: true } => drop(std::fs::remove_file(path)),
            Place::Beside {
                temporary,
                is_kept: true,
                is_empty: false,
                ..
            } => say!("{}: unchanged; the rows so far are in {}", self.name, temporary.display()),
            Place::Beside { temporary, .. } => {
                drop(std::fs::remove_file(temporary));
                interrupt::forget(temporary);
            }
            _ => {}
        }
    }
}
