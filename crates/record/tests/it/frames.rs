//! Frames on links that lose, reorder and damage them.

use crate::common::{Cells, Numbers, row_holds, rows, schema};
use fewbits_record::{Block, Error, FrameReader, FrameWriter, TimeBase};
use proptest::prelude::*;

/// All frames of the rows, the header's pieces first.
fn frames(truth: &[Cells], max_bytes: usize) -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let mut writer = FrameWriter::new(schema(128, TimeBase::Numbered), max_bytes).unwrap();
    let mut frames = Vec::new();
    for (i, row) in truth.iter().enumerate() {
        frames.extend(writer.push(i as i64, row).unwrap());
    }
    frames.extend(writer.flush().unwrap());
    assert_eq!(writer.waiting(), 0);
    (writer.header_frames(), frames)
}

fn keep(blocks: &[Block], truth: &[Cells], seen: &mut [usize]) {
    for block in blocks {
        for (i, tick) in block.ticks.iter().enumerate() {
            let row: Cells = block.columns.iter().map(|cells| cells[i]).collect();
            assert!(row_holds(&truth[*tick as usize], &row), "row {tick}: {row:?}");
            seen[*tick as usize] += 1;
        }
    }
}

#[test]
fn frames_are_no_longer_than_allowed() {
    let truth = rows(700);
    for max_bytes in [51, 120, 4000] {
        let (pieces, frames) = frames(&truth, max_bytes);
        assert!(pieces.iter().chain(&frames).all(|frame| frame.len() <= max_bytes));
        let (mut reader, mut seen) = (FrameReader::new(), vec![0; truth.len()]);
        for frame in pieces.iter().chain(&frames) {
            keep(&reader.handle(frame).unwrap(), &truth, &mut seen);
        }
        assert!(seen.iter().all(|count| *count == 1));
        // Full but for the last: no frame could have held a row more than half of its bytes.
        let total: usize = frames.iter().map(Vec::len).sum();
        assert!(max_bytes == 4000 || total * 4 > 3 * (frames.len() - 1) * max_bytes, "{max_bytes}");
    }
}

#[test]
fn lost_frames_lose_their_rows_only() {
    let truth = rows(2000);
    let (pieces, frames) = frames(&truth, 200);
    let (mut reader, mut seen) = (FrameReader::new(), vec![0; truth.len()]);
    let mut lost = 0;
    // The header comes last, pieces in reverse; every ninth frame is lost.
    for (i, frame) in frames.iter().chain(pieces.iter().rev()).enumerate() {
        if i % 9 == 4 && i < frames.len() {
            lost += 1;
            continue;
        }
        keep(&reader.handle(frame).unwrap(), &truth, &mut seen);
    }
    let missing = seen.iter().filter(|count| **count == 0).count();
    assert!(seen.iter().all(|count| *count <= 1) && missing > 0 && missing < truth.len() * 2 * lost / frames.len());
}

#[test]
fn two_percent_loss_of_frames_of_128_rows() {
    let truth = rows(128 * 150);
    let (pieces, frames) = frames(&truth, 1 << 16);
    let (mut reader, mut seen) = (FrameReader::new(), vec![0; truth.len()]);
    pieces
        .iter()
        .for_each(|piece| assert!(reader.handle(piece).unwrap().is_empty()));
    let (mut numbers, mut lost) = (Numbers(5), vec![false; frames.len()]);
    // A link that loses a frame in fifty, damages another one, and repeats a third.
    for (i, frame) in frames.iter().enumerate() {
        let fate = numbers.next();
        lost[i] = fate < 0.04;
        if fate < 0.02 {
            continue;
        }
        let mut arrived = frame.clone();
        if lost[i] {
            let bit = (numbers.next() * 8.0 * frame.len() as f64) as usize;
            arrived[bit / 8] ^= 1 << (bit % 8);
            assert!(reader.handle(&arrived).is_err());
            continue;
        }
        keep(&reader.handle(&arrived).unwrap(), &truth, &mut seen);
        if fate > 0.98 {
            keep(&reader.handle(&arrived).unwrap(), &truth, &mut vec![0; truth.len()]);
        }
    }
    // Rows without a value within its bound are those of the frames that did not arrive whole, and no others.
    assert!(lost.iter().filter(|lost| **lost).count() >= 3);
    for (row, count) in seen.iter().enumerate() {
        assert_eq!(*count == 0, lost[row / 128], "row {row}");
    }
}

#[test]
fn flipped_bits_in_frames_are_refused() {
    let truth = rows(100);
    let (pieces, frames) = frames(&truth, 100);
    let mut reader = FrameReader::new();
    for piece in &pieces {
        for bit in 0..8 * piece.len() {
            let mut flipped = piece.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            // A first byte that is not 0 makes it a block, which waits for the header and is refused then.
            assert!(reader.handle(&flipped).is_ok_and(|blocks| blocks.is_empty() && bit < 8) || bit >= 8);
        }
    }
    assert!(reader.schema().is_none());
    for piece in &pieces {
        assert!(reader.handle(piece).unwrap().is_empty());
    }
    assert!(reader.schema().is_some());
    for frame in &frames {
        for bit in 0..8 * frame.len() {
            let mut flipped = frame.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(reader.handle(&flipped).is_err());
        }
        assert_eq!(reader.handle(frame).unwrap().len(), 1);
    }
}

#[test]
fn too_short_frames_are_refused() {
    let refused = FrameWriter::new(schema(128, TimeBase::Numbered), 20).unwrap_err();
    assert!(matches!(refused, Error::Argument(_)));
    // A row of samples that must all be stored whole.
    let columns = (0..9).map(|i| fewbits_record::Column::new(format!("{i}"), fewbits_record::Bound::Lossless).unwrap());
    let schema = fewbits_record::Schema::new(columns.collect(), TimeBase::Numbered).unwrap();
    let mut writer = FrameWriter::new(schema, 51).unwrap();
    let row: Cells = (0..9)
        .map(|i| Some(0.1 + std::f64::consts::PI / f64::from(i + 1)))
        .collect();
    assert!(writer.push(0, &row).unwrap_err().to_string().contains("max_bytes"));
}

proptest! {
    #[test]
    fn arbitrary_frames_are_read_or_refused(
        noise in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..80), 0..20),
        with_header in any::<bool>(),
    ) {
        let (pieces, _) = frames(&rows(3), 100);
        let mut reader = FrameReader::new();
        if with_header {
            for piece in &pieces {
                reader.handle(piece).unwrap();
            }
        }
        for frame in noise {
            let mut piece = vec![0, b'H'];
            piece.extend(&frame);
            prop_assert!(reader.handle(&frame).is_ok_and(|blocks| blocks.is_empty()) || with_header || frame.first() == Some(&0));
            prop_assert!(reader.handle(&piece).is_err());
        }
    }
}
