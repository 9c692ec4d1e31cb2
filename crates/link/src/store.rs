//! A file that is always complete: a new version is written beside the old one and then replaces it.

use crate::error::Error;
use serde::{Serialize, de::DeserializeOwned};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A file with the state that a process must not lose.
#[derive(Debug, Clone)]
pub struct Store {
    path: PathBuf,
    durable: bool,
}

impl Store {
    /// A store in this file. The content survives the end of the process at any moment.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            durable: false,
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

    /// Replaces the content by `value`.
    ///
    /// # Errors
    /// If a file cannot be written. The old content is then unchanged.
    pub fn save(&self, value: &impl Serialize) -> Result<(), Error> {
        let beside = self.path.with_extension("new");
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| Error::File { path, source }
        };
        let bytes = serde_json::to_vec(value).map_err(|error| failed(&self.path)(error.into()))?;
        let mut file = File::create(&beside).map_err(failed(&beside))?;
        file.write_all(&bytes).map_err(failed(&beside))?;
        if self.durable {
            file.sync_all().map_err(failed(&beside))?;
        }
        drop(file);
        std::fs::rename(&beside, &self.path).map_err(failed(&self.path))
    }

    /// The content; `None` if there is no file yet.
    ///
    /// # Errors
    /// If the file cannot be read or is not of this type.
    pub fn load<T: DeserializeOwned>(&self) -> Result<Option<T>, Error> {
        let path = self.path.clone();
        match std::fs::read(&self.path) {
            Ok(bytes) => match serde_json::from_slice(&bytes) {
                Ok(value) => Ok(Some(value)),
                Err(error) => Err(Error::State {
                    path,
                    reason: error.to_string(),
                }),
            },
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::File { path, source }),
        }
    }
}
