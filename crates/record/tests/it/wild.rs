//! Wild arguments: columns, recordings and frames keep every promise, or refuse and stay as they were.

use crate::common::{Cells, read};
use fewbits_numerics::wild;
use fewbits_record::{Block, Bound, Column, FrameReader, FrameWriter, Recorder, Schema, TimeBase};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn column(which: u8, x: [f64; 4]) -> Option<Column> {
    let bound = match which % 4 {
        0 => Bound::Lossless,
        1 => Bound::Absolute(x[0]),
        2 => Bound::ShareOfRange(x[0]),
        _ => Bound::Decimals(which / 4),
    };
    let column = Column::new("x", bound).ok()?;
    let column = column.clone().with_period(x[1]).unwrap_or(column);
    Some(column.clone().with_range(x[2], x[3]).unwrap_or(column))
}

fn schema(column: &Column, rows_per_block: usize) -> Option<Schema> {
    let schema = Schema::new(vec![column.clone()], TimeBase::Numbered).ok()?;
    Some(schema.clone().with_rows_per_block(rows_per_block).unwrap_or(schema))
}

fn rows(cells: &[(u8, f64)]) -> Vec<Cells> {
    cells.iter().map(|(gap, x)| vec![(*gap > 20).then_some(*x)]).collect()
}

proptest! {
    #[test]
    fn recordings_keep_their_promise(which in any::<u8>(), x in prop::array::uniform4(wild()), rows_per_block in 0..9_usize, cells in prop::collection::vec((any::<u8>(), wild()), 1..12)) {
        let Some(column) = column(which, x) else { return Ok(()) };
        let Some(schema) = schema(&column, rows_per_block) else { return Ok(()) };
        let mut recorder = Recorder::new(Vec::new(), schema);
        let mut kept: Vec<Cells> = Vec::new();
        for row in rows(&cells) {
            if recorder.push_next(&row).is_ok() {
                kept.push(row);
            }
        }
        prop_assert!(recorder.push_next(&[]).is_err());
        let Ok(bytes) = recorder.finish() else { return Ok(()) };
        let restored = read(&bytes);
        prop_assert_eq!(restored.len(), kept.len());
        for (row, restored) in kept.iter().zip(&restored) {
            // A share's bound is that of the block, which rows do not tell: no more than the share of the largest range.
            let bound = match column.bound() {
                Bound::ShareOfRange(share) => share * f64::MAX,
                _ => 0.0,
            };
            prop_assert!(column.keeps(row[0], restored.values[0], Some(bound)), "{:?}: {:?} {:?}", column, row, restored);
        }
    }

    #[test]
    fn frames_keep_their_promise(which in any::<u8>(), x in prop::array::uniform4(wild()), max_bytes in 0..400_usize, cells in prop::collection::vec((any::<u8>(), wild()), 1..12), ticks in any::<[i64; 2]>()) {
        let Some(column) = column(which, x) else { return Ok(()) };
        let Some(schema) = schema(&column, 8) else { return Ok(()) };
        let Ok(mut writer) = FrameWriter::new(schema, max_bytes) else { return Ok(()) };
        let (mut frames, mut kept) = (Vec::new(), Vec::new());
        let (mut tick, step) = (ticks[0], ticks[1] % 1000);
        for row in rows(&cells) {
            let waiting = writer.waiting();
            match writer.push(tick, &row) {
                Ok(full) => {
                    frames.extend(full);
                    kept.push((tick, row));
                }
                Err(_) => prop_assert_eq!(writer.waiting(), waiting),
            }
            tick = tick.saturating_add(step);
        }
        let Ok(last) = writer.flush() else { return Ok(()) };
        frames.extend(last);
        prop_assert!(frames.iter().all(|frame| frame.len() <= max_bytes));
        let mut reader = FrameReader::new();
        let mut blocks: Vec<Block> = Vec::new();
        for frame in writer.header_frames().iter().chain(&frames) {
            blocks.extend(reader.handle(frame).unwrap());
        }
        let restored: Vec<_> = blocks.iter().flat_map(|b| (0..b.rows()).map(|i| (b.ticks[i], b.columns[0][i], b.share_bounds[0]))).collect();
        prop_assert_eq!(restored.len(), kept.len());
        for ((tick, row), (restored_tick, cell, bound)) in kept.iter().zip(&restored) {
            prop_assert_eq!(tick, restored_tick);
            prop_assert!(column.keeps(row[0], *cell, *bound), "{:?}: {:?} {:?} {:?}", column, row, cell, bound);
        }
    }
}
