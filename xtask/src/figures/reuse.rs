//! Results of earlier runs that still hold: same figure, parameters, seed and sources.

use super::record::Record;
use super::select::Job;
use serde_json::json;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;

// `SOURCES`, a hash for each system, and `BUILT_WITH`: the compiler, its target and its options.
include!(concat!(env!("OUT_DIR"), "/sources.rs"));

/// Fingerprint of all that a figure's result depends on; none for one whose system has no sources here.
pub(super) fn fingerprint(job: &Job, seed: u64) -> Option<String> {
    let id = job.figure.about().id;
    let system = id.split('-').next().unwrap_or_default();
    let (_, sources) = SOURCES.iter().find(|(name, _)| *name == system)?;
    let mut hasher = DefaultHasher::new();
    hasher.write(
        json!([
            id,
            job.run.parameters,
            seed,
            sources,
            BUILT_WITH,
            fewbits_experiments::FEATURES
        ])
        .to_string()
        .as_bytes(),
    );
    Some(format!("{:016x}", hasher.finish()))
}

/// The record of an earlier run with this fingerprint, if all its files are as it wrote them, the plot included where it is wanted.
pub(super) fn earlier(folder: &Path, job: &Job, fingerprint: &str, plots: bool) -> Option<Record> {
    let record = Record::read_one(folder, job.figure.about().id).ok()?;
    let same = record.error.is_none() && record.fingerprint.as_deref() == Some(fingerprint);
    let plotted = !plots || record.files.iter().any(|name| name.ends_with(".svg"));
    (same && plotted && record.damaged(folder).is_none()).then_some(record)
}
