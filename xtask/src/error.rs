//! Why a task could not be done.

use std::fmt;
use std::path::Path;

/// Why a task could not be done, in words. Nothing is made of it but a line.
#[derive(Debug)]
pub struct Error(pub(crate) String);

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl<E: std::error::Error> From<E> for Error {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl Error {
    /// Refuses the first name that is not among the valid ones.
    pub(crate) fn check_crates(names: &[String], valid: &[&str]) -> Result<(), Self> {
        match names.iter().find(|name| !valid.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => Err(Self(format!("no crate `{name}` for this task; these are: {}", valid.join(", ")))),
        }
    }

    pub(crate) fn reading(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self(format!("cannot read {}: {source}", path.display()))
    }

    pub(crate) fn writing(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self(format!("cannot write {}: {source}", path.display()))
    }

    pub(crate) fn cargo(source: std::io::Error) -> Self {
        Self(format!("cannot run cargo: {source}"))
    }
}
