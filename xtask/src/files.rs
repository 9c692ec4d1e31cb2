//! Reading and writing, with errors that name the file.

use crate::Error;
use std::path::{Path, PathBuf};

/// The text of a file.
pub(crate) fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(Error::reading(path))
}

/// Writes a text file.
pub(crate) fn write(path: &Path, text: &str) -> Result<(), Error> {
    std::fs::write(path, text).map_err(Error::writing(path))
}

/// The entries of a folder, in order.
pub(crate) fn list(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let entry = |entry: std::io::Result<std::fs::DirEntry>| Ok(entry?.path());
    let entries = std::fs::read_dir(path).and_then(|all| all.map(entry).collect::<std::io::Result<Vec<_>>>());
    let mut entries = entries.map_err(Error::reading(path))?;
    entries.sort();
    Ok(entries)
}

/// The sources below a folder, in order.
pub(crate) fn rust_files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for path in list(folder)? {
        if path.is_dir() {
            files.extend(rust_files(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(files)
}
