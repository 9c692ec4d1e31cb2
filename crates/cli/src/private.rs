//! Reading of files that may contain keys: only their owner may read them, and no error shows a line of them.

use crate::error::Error;
use serde::de::DeserializeOwned;
use std::path::Path;

/// The text of a file that only its owner may read.
pub(crate) fn text(path: &Path) -> Result<String, Error> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(Error::io(&name, "read"))?;
    fewbits_link::require_private(path)?;
    Ok(text)
}

/// The table of a TOML file.
pub(crate) fn table(path: &Path) -> Result<toml::Table, Error> {
    parse(path)
}

/// A configuration file in TOML.
pub(crate) fn configuration<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    parse(path)
}

fn parse<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let text = text(path)?;
    toml::from_str(&text).map_err(|error| {
        // The library's own message shows the line, which may be that of a key.
        let line = error
            .span()
            .map(|span| text[..span.start.min(text.len())].lines().count().max(1));
        let place = line.map_or_else(String::new, |line| format!("line {line}: "));
        Error::content(&path.display().to_string(), format_args!("{place}{}", error.message()))
    })
}

/// An error of a value in a configuration file.
pub(crate) fn configured<E: std::fmt::Display>(path: &Path) -> impl Fn(E) -> Error + use<E> {
    let file = path.display().to_string();
    move |error| Error::content(&file, error)
}
