//! Names of files with wildcards, and whether a task has several files.

use crate::arguments::{ManyOptions, Task};
use crate::error::Error;
use std::path::{Path, PathBuf};

fn is_pattern(file: &str) -> bool {
    file.contains(['*', '?', '[']) && !Path::new(file).exists()
}

/// Whether the task is one of several files.
pub(crate) fn are_several(task: &Task) -> bool {
    let of = |file: &str, many: &ManyOptions, folder: Option<&PathBuf>| {
        !many.more.is_empty() || many.shard.is_some() || is_pattern(file) || folder.is_some_and(|path| path.is_dir())
    };
    match task {
        Task::Pack(options) => of(&options.table.file, &options.many, options.output.as_ref()),
        Task::Track(options) => of(&options.table.file, &options.many, options.output.as_ref()),
        Task::Ranges(options) => of(&options.table.file, &options.many, options.output.as_ref()),
        Task::Verify(options) => of(&options.table.file, &options.many, Some(&options.packed)),
        _ => false,
    }
}

/// The names of all files, each once, in the given order; those of a wildcard are sorted.
pub(crate) fn expanded_in_order(names: &[&str]) -> Result<Vec<String>, Error> {
    let mut files: Vec<String> = Vec::new();
    for name in names {
        let mut found = match is_pattern(name) {
            // What cannot be read is named when its turn comes.
            true => glob::glob(name)
                .map_err(|error| Error::content(name, error))?
                .map(|path| path.unwrap_or_else(|error| error.path().to_owned()))
                .filter(|path| !path.is_dir())
                .map(|path| path.to_string_lossy().into_owned())
                .collect(),
            false => vec![(*name).to_owned()],
        };
        if found.is_empty() {
            return Err(Error::content(name, "no file has a name like this"));
        }
        found.sort();
        found.retain(|file| !files.contains(file));
        files.extend(found);
    }
    Ok(files)
}
