//! A file that is always complete: a new version is written beside the old one and then replaces it.

use crate::disk::{Disk, Files};
use crate::error::Error;
use crate::private::{created, require_private};
use serde::{Serialize, de::DeserializeOwned};
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file with the state that a process must not lose. Only its owner may read it.
///
/// `FILE.new.PID` is the next version while process PID writes it. `FILE.lock` is held by the process that uses the state.
#[derive(Debug, Clone)]
pub struct Store {
    path: PathBuf,
    durable: bool,
    lock: Option<Arc<File>>,
}

impl Store {
    /// A store in this file. The content survives the end of the process at any moment.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            durable: false,
            lock: None,
        }
    }

    /// The same store, safe against power failure too: every write waits for the disk, which takes milliseconds.
    #[must_use]
    pub fn durable(self) -> Self {
        Self { durable: true, ..self }
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The same store, held against other processes and other stores of this one until it and its copies are dropped. Removes what a
    /// process that was stopped while it wrote has left behind.
    ///
    /// # Errors
    /// [`Error::Locked`] if the state is held already; [`Error::File`] if the file of the lock cannot be created.
    pub fn locked(mut self) -> Result<Self, Error> {
        if self.lock.is_some() {
            return Ok(self);
        }
        let path = self.beside(".lock");
        let failed = |source| Error::File {
            path: path.clone(),
            source,
        };
        // The file stays: another process may wait for exactly this one.
        let file = created().create(true).truncate(false).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(Error::Locked { path: self.path }),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(source)) => return Err(failed(source)),
        }
        self.lock = Some(Arc::new(file));
        self.remove_unfinished();
        Ok(self)
    }

    /// A name beside the file: its whole name with an ending, so that two files never share one.
    fn beside(&self, ending: &str) -> PathBuf {
        let mut name = self.path.clone().into_os_string();
        name.push(ending);
        name.into()
    }

    fn folder(&self) -> &Path {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new("."))
    }

    fn remove_unfinished(&self) {
        let start = self.beside(".new.");
        let Some(start) = start.file_name().and_then(|name| name.to_str()) else {
            return;
        };
        for entry in std::fs::read_dir(self.folder()).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let process = name.to_str().and_then(|name| name.strip_prefix(start));
            if process.is_some_and(|process| process.parse::<u32>().is_ok()) {
                // One that stays does no harm.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }

    /// Replaces the content by `value`.
    ///
    /// # Errors
    /// If a file cannot be written. The old content is then unchanged.
    pub fn save(&self, value: &impl Serialize) -> Result<(), Error> {
        let beside = self.beside(&format!(".new.{}", std::process::id()));
        let bytes = serde_json::to_vec(value).map_err(|error| Error::File {
            path: self.path.clone(),
            source: error.into(),
        })?;
        self.replace(&Files, &beside, &bytes)
            .map_err(|(path, source)| Error::File { path, source })
    }

    /// Writes the next version beside the file and renames it; says which path failed.
    fn replace<D: Disk>(&self, disk: &D, beside: &Path, bytes: &[u8]) -> Result<(), (PathBuf, std::io::Error)> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| (path, source)
        };
        // A file of that name is left from a process of the same number: it may have other rights.
        match disk.remove(beside) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(beside)(error)),
            _ => {}
        }
        let mut file = disk.create(beside).map_err(failed(beside))?;
        disk.write(&mut file, bytes).map_err(failed(beside))?;
        if self.durable {
            disk.sync(&file).map_err(failed(beside))?;
        }
        drop(file);
        disk.rename(beside, &self.path).map_err(failed(&self.path))?;
        // The new name is safe once the folder is.
        if self.durable {
            let folder = self.folder();
            disk.sync_folder(folder).map_err(failed(folder))?;
        }
        Ok(())
    }

    /// The content; `None` if there is no file yet.
    ///
    /// # Errors
    /// If the file cannot be read, is not of this type, or others than its owner may read it.
    pub fn load<T: DeserializeOwned>(&self) -> Result<Option<T>, Error> {
        let path = self.path.clone();
        match std::fs::read(&self.path) {
            Ok(bytes) => {
                require_private(&self.path)?;
                match serde_json::from_slice(&bytes) {
                    Ok(value) => Ok(Some(value)),
                    Err(error) => Err(Error::State {
                        path,
                        reason: error.to_string(),
                    }),
                }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::File { path, source }),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::disk::model::Model;

    /// What may be in the file after a power failure at any moment while `new` replaces `old`, and after that.
    fn after_failures(store: &Store, fails: Option<usize>) -> (Vec<Vec<u8>>, Vec<Vec<u8>>, bool) {
        let disk = Model::with(store.path(), b"old version");
        disk.fail_at(fails);
        let outcome = store.replace(&disk, Path::new("folder/state.new.1"), b"new version");
        (disk.seen(), disk.possible(store.path()), outcome.is_ok())
    }

    #[test]
    fn a_durable_state_survives_a_power_failure_at_any_moment() {
        let whole = |content: &Vec<u8>| content == b"old version" || content == b"new version";
        let durable = Store::new("folder/state").durable();
        let (during, after, is_good) = after_failures(&durable, None);
        assert!(is_good && during.iter().all(whole), "{during:?}");
        // Both the file and its folder are on the disk when the call returns.
        assert_eq!(after, [b"new version".to_vec()]);
        // Each call may fail. What is there then is whole, and the error is returned.
        for fails in 0..6 {
            let (during, after, is_good) = after_failures(&durable, Some(fails));
            assert!(during.iter().chain(&after).all(whole), "call {fails}: {during:?}, {after:?}");
            // That there is nothing to remove is no error.
            assert_eq!(is_good, fails == 0, "call {fails}");
        }
        // Without waiting for the disk the name may be there before the content: the test would see it.
        let (during, after, _) = after_failures(&Store::new("folder/state"), None);
        assert!(during.iter().any(|content| content.is_empty()) && after.len() > 1);
    }

    #[test]
    fn what_the_real_disk_does_is_what_the_model_does() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path().join("state")).durable();
        for value in 0..3_u32 {
            store.save(&value).unwrap();
            assert_eq!(store.load::<u32>().unwrap(), Some(value));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        // A folder that cannot be synchronised is an error.
        let gone = Store::new(folder.path().join("gone/state")).durable();
        assert!(matches!(gone.save(&1_u32), Err(Error::File { .. })));
    }
}
