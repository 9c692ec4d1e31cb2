//! How a sensor reports, and configuration files.

use crate::error::Error;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// How a sensor reports; the same in the files of sensor and centre.
#[derive(Deserialize, Clone, Copy)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Report {
    /// One bit: whether the sample is at or above what was predicted.
    Sign,
    /// The cell of the innovation, in 2 to 4 bits.
    Word {
        /// Bits of a report.
        bits: usize,
    },
    /// Every sample, in double precision.
    Value,
    /// The sample if its innovation exceeds so many standard deviations, otherwise silence.
    Censored {
        /// Standard deviations.
        threshold: f64,
    },
}

/// Reads a TOML file.
pub(crate) fn configuration<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(Error::file(&name, "read"))?;
    toml::from_str(&text).map_err(|error| Error::Configuration {
        file: name,
        reason: error.to_string(),
    })
}

/// An error of a value in a configuration file.
pub(crate) fn configured<E: std::fmt::Display>(path: &Path) -> impl Fn(E) -> Error + use<E> {
    let file = path.display().to_string();
    move |error| Error::Configuration {
        file: file.clone(),
        reason: error.to_string(),
    }
}
