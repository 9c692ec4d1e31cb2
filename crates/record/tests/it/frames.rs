//! Frames on links that lose, reorder and damage them.

use crate::common::{Cells, Numbers, row_holds, rows, schema};
use fewbits_record::{Block, Bound, Column, Damage, Error, FrameReader, FrameWriter, HeaderRepeats, Schema, TimeBase};
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
        // The header came first: only when it comes again is it known that no frame is missing.
        assert_eq!(reader.uncounted(), frames.len() as u64);
        keep(&reader.handle(&pieces[0]).unwrap(), &truth, &mut seen);
        assert_eq!(reader.uncounted(), 0);
        assert!(seen.iter().all(|count| *count == 1));
        // Full but for the last: no frame could have held a row more than half of its bytes.
        assert_eq!((reader.missing(), reader.received()), (0, frames.len() as u64));
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
    assert_eq!(reader.uncounted(), 0, "the header came last");
    let missing = seen.iter().filter(|count| **count == 0).count();
    assert_eq!((reader.missing(), reader.received()), (lost as u64, (frames.len() - lost) as u64));
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
            assert!(reader.handle(&arrived).unwrap().is_empty());
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
    let columns = (0..9).map(|i| Column::new(format!("{i}"), Bound::Lossless).unwrap());
    let schema = Schema::new(columns.collect(), TimeBase::Numbered).unwrap();
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
            let mut piece = vec![0, b'P'];
            piece.extend(&frame);
            prop_assert!(reader.handle(&frame).is_ok_and(|blocks| blocks.is_empty()) || with_header || frame.first() == Some(&0));
            prop_assert!(reader.handle(&piece).is_err());
        }
    }
}

/// Frames of the table with its header repeated, without those that `lose` names by their number.
fn sent(
    truth: &[Cells],
    max_bytes: usize,
    share: f64,
    mut lose: impl FnMut(usize) -> bool,
) -> (Vec<Vec<u8>>, [usize; 3]) {
    let mut writer = FrameWriter::new(schema(128, TimeBase::Numbered), max_bytes).unwrap();
    let mut repeats = HeaderRepeats::share(share).unwrap();
    let mut all = Vec::new();
    for (i, row) in truth.iter().enumerate() {
        for frame in writer.push(i as i64, row).unwrap() {
            all.extend(repeats.around(&writer, frame));
        }
    }
    for frame in writer.flush().unwrap() {
        all.extend(repeats.around(&writer, frame));
    }
    all.extend(repeats.at_end(&writer));
    let header: usize = writer.header_frames().iter().map(Vec::len).sum();
    let pieces: usize = all.iter().filter(|frame| frame[0] == 0).map(Vec::len).sum();
    let total: usize = all.iter().map(Vec::len).sum();
    let mut number = 0..;
    all.retain(|_| !lose(number.next().unwrap()));
    (all, [header, pieces, total])
}

#[test]
fn header_is_repeated_within_its_share_and_no_single_frame_is_needed() {
    let truth = rows(3000);
    for share in [0.0, 0.05, 0.1, 0.5] {
        let (all, [header, pieces, total]) = sent(&truth, 120, share, |_| false);
        let most = share * total as f64 + 6.0 * header as f64;
        assert!(pieces as f64 <= most, "{pieces} of {total} bytes at {share}");
        assert!(share == 0.0 || pieces as f64 > 0.8 * share * total as f64, "{pieces} of {total} bytes at {share}");
        // Whichever frame is lost, all other frames are read.
        for lost in (0..all.len()).step_by(7).chain(0..8) {
            let mut reader = FrameReader::new();
            let mut seen = vec![0; truth.len()];
            for (_, frame) in all.iter().enumerate().filter(|(i, _)| *i != lost) {
                keep(&reader.handle(frame).unwrap(), &truth, &mut seen);
            }
            let is_piece = all[lost][0] == 0;
            assert_eq!(reader.missing(), u64::from(!is_piece));
            assert!(!is_piece || seen.iter().all(|count| *count == 1));
        }
    }
}

/// A short day over a link that loses every fifth frame: none of a thousand loses its header.
#[test]
fn days_over_a_bad_link_are_read() {
    let truth = rows(400);
    let mut numbers = Numbers(11);
    for day in 0..200 {
        let (frames, _) = sent(&truth, 60, 0.1, |_| numbers.next() < 0.2);
        let (mut reader, mut seen) = (FrameReader::new(), vec![0; truth.len()]);
        for frame in &frames {
            keep(&reader.handle(frame).unwrap(), &truth, &mut seen);
        }
        assert!(reader.schema().is_some(), "day {day}: {:?}", reader.pieces());
        let blocks = frames.iter().filter(|frame| frame[0] != 0).count() as u64;
        assert_eq!((reader.received(), reader.waiting()), (blocks, 0));
        assert!(seen.iter().all(|count| *count <= 1));
    }
}

#[test]
fn frames_of_another_table_are_refused() {
    let truth = rows(300);
    let (pieces, own) = frames(&truth, 100);
    let (other_pieces, others) = frames(&rows(301)[1..], 100);
    let columns = vec![Column::new("only", Bound::Lossless).unwrap()];
    let mut narrow = FrameWriter::new(Schema::new(columns, TimeBase::Numbered).unwrap(), 100).unwrap();
    narrow.push(0, &[Some(1.0)]).unwrap();
    let narrow_frames = narrow.flush().unwrap();
    let (mut reader, mut seen) = (FrameReader::new(), vec![0; truth.len()]);
    // The pieces of both come in turn, and neither keeps the other from being complete.
    let incomplete = &other_pieces[..other_pieces.len() - 1];
    for (i, one) in pieces.iter().enumerate() {
        if let Some(other) = incomplete.get(i) {
            assert!(reader.handle(other).unwrap().is_empty());
        }
        keep(&reader.handle(one).unwrap(), &truth, &mut seen);
    }
    assert!(reader.schema().is_some());
    let mut reader = FrameReader::new();
    for piece in &pieces {
        reader.handle(piece).unwrap();
    }
    for piece in other_pieces.iter().chain(&narrow.header_frames()) {
        assert!(matches!(reader.handle(piece), Err(Error::OtherTable)));
    }
    for frame in others.iter().chain(&narrow_frames) {
        assert!(matches!(
            reader.handle(frame),
            Err(Error::Block {
                damage: Damage::Checksum,
                ..
            })
        ));
    }
    assert_eq!(reader.schema().unwrap().columns().len(), schema(128, TimeBase::Numbered).columns().len());
    own.iter()
        .chain(&own)
        .for_each(|frame| keep(&reader.handle(frame).unwrap(), &truth, &mut seen));
    assert!(seen.iter().all(|count| *count == 1));
    assert_eq!(reader.repeated(), own.len() as u64);
}

/// Few bytes may stand for many rows: only as many as a reader is willing to hold.
#[test]
fn small_frames_demand_little_memory() {
    let columns = |n: usize| {
        (0..n)
            .map(|i| Column::new(format!("{i}"), Bound::Lossless).unwrap())
            .collect()
    };
    for n in [1, 3, 40] {
        let schema = Schema::new(columns(n), TimeBase::Numbered).unwrap();
        let schema = schema.with_rows_per_block((1 << 22) / (n + 1)).unwrap();
        let mut writer = FrameWriter::new(schema, 1 << 16).unwrap();
        let row = vec![Some(20.0); n];
        let (mut frames, mut i) = (Vec::new(), 0);
        while frames.is_empty() {
            frames = writer.push(i, &row).unwrap();
            i += 1;
        }
        let mut reader = FrameReader::new();
        for piece in writer.header_frames() {
            reader.handle(&piece).unwrap();
        }
        let blocks = reader.handle(&frames[0]).unwrap();
        assert!(frames[0].len() < 1000 && blocks[0].rows() * (n + 1) <= 1 << 17, "{} rows", blocks[0].rows());
    }
}
