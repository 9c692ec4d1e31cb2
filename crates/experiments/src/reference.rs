//! Reference values, found by key: `references/<system>.csv` beside this crate's sources.
//!
//! Columns: `key` (`<figure>/<quantity>/<row>`), `value`, `standard_error` (empty for exact values), `tolerance` (absolute, what
//! rounding and the other method's own error allow), `source` (a publication, or `independent`), `method` (how it was computed:
//! program idea, trials, seed).

use serde::Deserialize;
use std::sync::LazyLock;

/// A known value.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// `<figure>/<quantity>/<row>`.
    pub key: String,
    /// The value.
    pub value: f64,
    /// Its standard error, if it was simulated.
    pub standard_error: Option<f64>,
    /// Absolute deviation allowed on top of standard errors.
    pub tolerance: f64,
    /// Who says so.
    pub source: String,
    /// How it was computed.
    pub method: String,
}

type Read = Result<Vec<Reference>, String>;

fn read(system: &str, text: &str) -> Read {
    let rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
    let rows: Result<_, csv::Error> = rows.collect();
    rows.map_err(|error| format!("references of {system}: {error}"))
}

macro_rules! systems {
    ($($system:literal),* $(,)?) => {
        static SYSTEMS: LazyLock<Vec<(&str, Read)>> = LazyLock::new(|| vec![
            $(($system, read($system, include_str!(concat!("../references/", $system, ".csv"))))),*
        ]);
    };
}
systems![
    "assign",
    "binary",
    "cfwmd",
    "diffusive",
    "dymbo",
    "handoff",
    "mi",
    "mpa",
    "problems",
    "targets"
];

fn of(key: &str) -> Result<&'static [Reference], String> {
    let system = key.split('-').next().unwrap_or_default();
    let found = SYSTEMS.iter().find(|(name, _)| *name == system);
    let (_, read) = found.ok_or_else(|| format!("no references of system `{system}`"))?;
    read.as_deref().map_err(Clone::clone)
}

/// The references `<figure>/<quantity>/...` with the rest of their keys.
///
/// # Errors
/// If the system's file cannot be read.
pub fn group(figure: &str, quantity: &str) -> Result<Vec<(&'static str, &'static Reference)>, String> {
    let group = format!("{figure}/{quantity}/");
    let rest = |r: &'static Reference| Some((r.key.strip_prefix(&group)?, r));
    Ok(of(figure)?.iter().filter_map(rest).collect())
}

/// The quantities of a figure that have references, each once, in the order of the file.
///
/// # Errors
/// If the system's file cannot be read.
pub fn quantities(figure: &str) -> Result<Vec<&'static str>, String> {
    let own = format!("{figure}/");
    let mut quantities = Vec::new();
    for reference in of(figure)? {
        let quantity = reference.key.strip_prefix(&own).and_then(|rest| rest.split('/').next());
        quantities.extend(quantity.filter(|quantity| !quantities.contains(quantity)));
    }
    Ok(quantities)
}

/// What is known under `key`.
pub fn find(key: &str) -> Option<&'static Reference> {
    of(key).ok()?.iter().find(|r| r.key == key)
}

/// The value under `key`, such as one printed for just this row's setting; `None` beside any other setting.
pub fn value(key: &str) -> Option<f64> {
    find(key).map(|r| r.value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn all_references_are_readable_and_their_keys_unique() {
        for (system, read) in SYSTEMS.iter() {
            let references = read.as_ref().unwrap();
            let mut keys = BTreeSet::new();
            for r in references {
                assert!(r.key.starts_with(&format!("{system}-")) && r.key.split('/').count() >= 3, "{}", r.key);
                assert!(keys.insert(&r.key), "{} twice", r.key);
                assert!(r.value.is_finite() && r.tolerance >= 0.0 && !r.source.is_empty(), "{}", r.key);
                assert!(r.standard_error.is_none_or(|s| s > 0.0), "{}", r.key);
            }
        }
    }

    #[test]
    fn a_broken_file_says_where() {
        let message = read("x", "key,value,standard_error,tolerance,source,method\na/b/c,much,,0,x,y\n").unwrap_err();
        assert!(
            message.contains("references of x") && message.contains("much") || message.contains("invalid float"),
            "{message}"
        );
    }
}
