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
    let (mut rows, mut row) = (0, Vec::with_capacity(columns));
    while let Some(batch) = source.next_batch().map_err(Error::Source)? {
        batch.check(columns)?;
        for index in 0..batch.rows() {
            batch.row(index, &mut row);
            match &batch.ticks {
                Some(ticks) => recorder.push(ticks[index], &row)?,
                None => recorder.push_next(&row)?,
            }
        }
        rows += batch.rows() as u64;
        report(watch, rows)?;
    }
    Ok(rows)
}
