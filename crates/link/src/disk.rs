//! The calls of the file system with which a state is replaced.

use crate::private::created;
use std::fs::File;
use std::io::{Result, Write};
use std::path::Path;

/// What a new version of a file takes, in this order.
pub(crate) trait Disk {
    /// A file that is open for writing.
    type File;

    fn remove(&self, path: &Path) -> Result<()>;
    /// A new file that only its owner may read.
    fn create(&self, path: &Path) -> Result<Self::File>;
    fn write(&self, file: &mut Self::File, bytes: &[u8]) -> Result<()>;
    /// Returns when the content is on the disk.
    fn sync(&self, file: &Self::File) -> Result<()>;
    fn rename(&self, from: &Path, to: &Path) -> Result<()>;
    /// Returns when the names of a folder are on the disk.
    fn sync_folder(&self, folder: &Path) -> Result<()>;
}

/// The files of this machine.
pub(crate) struct Files;

impl Disk for Files {
    type File = File;

    fn remove(&self, path: &Path) -> Result<()> {
        std::fs::remove_file(path)
    }

    fn create(&self, path: &Path) -> Result<File> {
        created().create_new(true).open(path)
    }

    fn write(&self, file: &mut File, bytes: &[u8]) -> Result<()> {
        file.write_all(bytes)
    }

    fn sync(&self, file: &File) -> Result<()> {
        file.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        std::fs::rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> Result<()> {
        // Other systems than Unix do not open folders.
        match cfg!(unix) {
            true => File::open(folder)?.sync_all(),
            false => Ok(()),
        }
    }
}

#[cfg(test)]
pub(crate) mod model {
    //! A disk that loses power: what was not synchronised may be there or not, a file's content in any part.

    use super::*;
    use std::cell::RefCell;
    use std::collections::BTreeMap;
    use std::io::{Error, ErrorKind};
    use std::path::PathBuf;

    #[derive(Default)]
    struct Content {
        written: Vec<u8>,
        is_synced: bool,
    }

    type Names = BTreeMap<PathBuf, usize>;

    #[derive(Default)]
    struct Inner {
        contents: Vec<Content>,
        /// The names since the folder was synchronised, the latest last. The disk may hold any of these.
        names: Vec<Names>,
        calls: usize,
        fail_at: Option<usize>,
        seen: Vec<Vec<u8>>,
        watched: PathBuf,
    }

    pub(crate) struct Model(RefCell<Inner>);

    impl Inner {
        fn possible(&self, path: &Path) -> Vec<Vec<u8>> {
            let mut all = Vec::new();
            for content in self.names.iter().map(|names| &self.contents[names[path]]) {
                let shortest = if content.is_synced { content.written.len() } else { 0 };
                all.extend((shortest..=content.written.len()).map(|length| content.written[..length].to_vec()));
            }
            all.sort();
            all.dedup();
            all
        }

        fn latest(&self) -> Names {
            self.names.last().cloned().unwrap_or_default()
        }
    }

    impl Model {
        /// A disk with one file.
        pub(crate) fn with(path: &Path, content: &[u8]) -> Self {
            let content = Content {
                written: content.to_vec(),
                is_synced: true,
            };
            Self(RefCell::new(Inner {
                contents: vec![content],
                names: vec![Names::from([(path.to_owned(), 0)])],
                watched: path.to_owned(),
                ..Inner::default()
            }))
        }

        /// The call of this number, counted from 0, fails and does nothing.
        pub(crate) fn fail_at(&self, call: Option<usize>) {
            self.0.borrow_mut().fail_at = call;
        }

        /// What may be in the file after a power failure now.
        pub(crate) fn possible(&self, path: &Path) -> Vec<Vec<u8>> {
            self.0.borrow().possible(path)
        }

        /// What might have been in it after a power failure behind any call so far.
        pub(crate) fn seen(&self) -> Vec<Vec<u8>> {
            self.0.borrow().seen.clone()
        }

        fn call<T>(&self, act: impl FnOnce(&mut Inner) -> Result<T>) -> Result<T> {
            let mut inner = self.0.borrow_mut();
            let number = inner.calls;
            inner.calls += 1;
            let outcome = match inner.fail_at == Some(number) {
                // What is not there cannot be removed: the one failure that a caller may pass over.
                true if number == 0 => Err(ErrorKind::NotFound.into()),
                true => Err(Error::other("the disk fails")),
                false => act(&mut inner),
            };
            let possible = inner.possible(&inner.watched);
            inner.seen.extend(possible);
            outcome
        }
    }

    impl Disk for Model {
        type File = usize;

        fn remove(&self, path: &Path) -> Result<()> {
            self.call(|inner| {
                let mut names = inner.latest();
                names.remove(path).ok_or(ErrorKind::NotFound)?;
                inner.names.push(names);
                Ok(())
            })
        }

        fn create(&self, path: &Path) -> Result<usize> {
            self.call(|inner| {
                let mut names = inner.latest();
                inner.contents.push(Content::default());
                let place = inner.contents.len() - 1;
                names.insert(path.to_owned(), place);
                inner.names.push(names);
                Ok(place)
            })
        }

        fn write(&self, file: &mut usize, bytes: &[u8]) -> Result<()> {
            self.call(|inner| {
                inner.contents[*file].written.extend(bytes);
                Ok(())
            })
        }

        fn sync(&self, file: &usize) -> Result<()> {
            self.call(|inner| {
                inner.contents[*file].is_synced = true;
                Ok(())
            })
        }

        fn rename(&self, from: &Path, to: &Path) -> Result<()> {
            self.call(|inner| {
                let mut names = inner.latest();
                let place = names.remove(from).ok_or(ErrorKind::NotFound)?;
                names.insert(to.to_owned(), place);
                inner.names.push(names);
                Ok(())
            })
        }

        fn sync_folder(&self, _: &Path) -> Result<()> {
            self.call(|inner| {
                inner.names = vec![inner.latest()];
                Ok(())
            })
        }
    }
}
