//! What fuzzers and the stable test `fuzz` run on any bytes.

use fewbits_record::{BlockReader, FrameReader, Playback, Schema};
use std::io::Cursor;

/// Blocks and rows that are read at most: a few bytes may stand for many rows that are alike.
const MAX_BLOCKS: usize = 64;
const MAX_ROWS: usize = 20_000;

/// Cells of one block that a header states, times included.
pub fn stated_cells(schema: &Schema) -> usize {
    (schema.columns().len() + 1) * schema.rows_per_block()
}

/// Opens bytes as a recording and reads all of it; returns the cells of a block as the header states them.
pub fn playback(bytes: &[u8]) -> Option<usize> {
    let mut playback = Playback::new(Cursor::new(bytes)).ok()?;
    let (cells, columns) = (stated_cells(playback.schema()), playback.schema().columns().len());
    let _ = playback.index();
    let rows = playback.rows().take(MAX_ROWS).flatten();
    rows.for_each(|row| assert_eq!(row.values.len(), columns));
    if let Ok(reader) = BlockReader::new(bytes) {
        reader.take(MAX_BLOCKS).for_each(drop);
    }
    Some(cells)
}

/// Takes bytes as frames, each behind its length in two bytes, and receives them; returns the cells of a block as the header states
/// them.
pub fn receive(bytes: &[u8]) -> Option<usize> {
    let (mut reader, mut rest) = (FrameReader::new(), bytes);
    let mut frames = 0;
    while let [a, b, behind @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*a, *b])).min(behind.len());
        let (frame, behind) = behind.split_at(length);
        rest = behind;
        if let Ok(blocks) = reader.handle(frame) {
            let columns = reader.schema().map_or(0, |schema| schema.columns().len());
            for block in blocks {
                assert!(
                    block.columns.len() == columns && block.columns.iter().all(|cells| cells.len() == block.rows())
                );
            }
        }
        frames += 1;
        if frames == MAX_BLOCKS {
            break;
        }
    }
    reader.schema().map(stated_cells)
}
