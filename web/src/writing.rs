//! A recording as CSV, as `fewbits unpack` writes it.

use crate::text;
pub(crate) use fewbits_recipes::times::shown as tick;
use fewbits_recipes::unpack::{self, Cell, Cells, Selection};
pub(crate) use fewbits_recipes::words::of as words_of;
use fewbits_record::Playback;
use std::io::Cursor;
use std::ops::ControlFlow;

/// All rows of a recording as CSV.
pub(crate) fn csv(recording: &[u8]) -> Result<Vec<u8>, String> {
    let mut playback = Playback::new(Cursor::new(recording)).map_err(text)?;
    let all = Selection::all(playback.schema());
    let cells = Cells::new(playback.schema(), &all.names, false);
    let mut rows = csv::Writer::from_writer(Vec::new());
    rows.write_record(cells.names()).map_err(text)?;
    let (mut damage, mut go) = (None, |_| ControlFlow::Continue(()));
    unpack::rows(
        playback.blocks(),
        &all,
        &mut |at, values| Ok(rows.write_record(cells.row(at, values).map(|cell: Cell| cell.text()))?),
        &mut |error| damage = damage.take().or_else(|| Some(error.to_string())),
        &mut go,
    )
    .map_err(text)?;
    match damage {
        Some(damage) => Err(damage),
        None => rows.into_inner().map_err(|error| error.to_string()),
    }
}
