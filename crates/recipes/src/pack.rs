//! Rows of a source into a recording.

use crate::error::Error;
use crate::source::{Source, Watch, report};
use fewbits_record::Recorder;
use std::io::Write;

/// Writes all rows of a source. Rows without ticks are numbered on from the recorder's last. Returns the number of rows.
///
/// The recorder is not finished: the caller decides what becomes of rows that were taken before an error.
///
/// # Errors
/// If the source or the recorder fails, a batch does not fit the recorder's columns, or `watch` breaks.
pub fn fill<W: Write>(
    source: &mut dyn Source,
    recorder: &mut Recorder<W>,
    watch: &mut Watch<'_>,
) -> Result<u64, Error> {
    let columns = recorder.schema().columns().len();
    let mut rows = 0;
    while let Some(batch) = source.next_batch().map_err(Error::Source)? {
        batch.check(columns)?;
        let ticks = batch.ticks.unwrap_or_else(|| {
            let first = recorder.next_tick();
            let rows = batch.columns.first().map_or(0, Vec::len) as i64;
            (0..rows).map(|row| first.wrapping_add(row)).collect()
        });
        recorder.push_columns(&ticks, &batch.columns)?;
        rows += ticks.len() as u64;
        report(watch, rows)?;
    }
    Ok(rows)
}
