//! Results of earlier runs that still hold: same figure, parameters, seed and program.

use super::record::{Record, check_sum};
use super::select::Job;
use serde_json::json;
use std::path::Path;
use std::sync::LazyLock;

/// Check sum of this program, which cargo makes anew when a source, a dependency, a feature or the compiler changes; none if it cannot
/// be read.
static PROGRAM: LazyLock<Option<String>> = LazyLock::new(|| {
    let program = std::fs::read(std::env::current_exe().ok()?).ok()?;
    Some(check_sum(&program))
});

/// Fingerprint of all that a figure's result depends on.
pub(super) fn fingerprint(job: &Job, seed: u64) -> Option<String> {
    let program = PROGRAM.as_ref()?;
    let all = json!([job.figure.about().id, job.run.parameters, seed, program]);
    Some(check_sum(all.to_string().as_bytes()))
}

/// The record of an earlier run with this fingerprint, if all its files are as it wrote them, the plot included where it is wanted.
pub(super) fn earlier(folder: &Path, job: &Job, fingerprint: &str, plots: bool) -> Option<Record> {
    let record = Record::read_one(folder, job.figure.about().id).ok()?;
    let same = record.error.is_none() && record.fingerprint.as_deref() == Some(fingerprint);
    let plotted = !plots || record.files.iter().any(|name| name.ends_with(".svg"));
    (same && plotted && record.damaged(folder).is_none()).then_some(record)
}
