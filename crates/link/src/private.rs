//! Files that only their owner may read: keys and states.

use crate::error::Error;
use std::fs::OpenOptions;
use std::path::Path;

/// Options of a new file that only its owner may read and write.
pub(crate) fn created() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Checks that no other user of the machine may read or write a file with keys or a state. What is not a regular file, as a pipe, passes,
/// and so does every file on systems without such rights.
///
/// # Errors
/// [`Error::Shared`] if others may; [`Error::File`] if the file does not exist.
pub fn require_private(path: &Path) -> Result<(), Error> {
    let metadata = std::fs::metadata(path).map_err(|source| Error::File {
        path: path.to_owned(),
        source,
    })?;
    #[cfg(unix)]
    {
        let mode = std::os::unix::fs::PermissionsExt::mode(&metadata.permissions()) & 0o777;
        if metadata.is_file() && mode & 0o077 != 0 {
            return Err(Error::Shared {
                path: path.to_owned(),
                mode,
            });
        }
    }
    let _ = metadata;
    Ok(())
}

/// Writes a new file that only its owner may read.
///
/// # Errors
/// If the file exists or cannot be written.
pub fn write_private(path: &Path, text: &str) -> Result<(), Error> {
    let written = created().create_new(true).open(path);
    let written = written.and_then(|mut file| std::io::Write::write_all(&mut file, text.as_bytes()));
    written.map_err(|source| Error::File {
        path: path.to_owned(),
        source,
    })
}
