//! Arbitrary bytes, mutated files, arbitrary cells.

use crate::common::{read, record, rows, schema};
use fewbits_record::{BlockReader, Bound, Column, Playback, Schema, TimeBase};
use proptest::prelude::*;
use std::io::Cursor;

/// Reads everything in both ways, whatever comes.
fn read_all(bytes: &[u8]) {
    if let Ok(mut playback) = Playback::new(Cursor::new(bytes)) {
        let _ = playback.index();
        assert!(playback.rows().take(100_000).count() < 100_000);
    }
    if let Ok(reader) = BlockReader::new(bytes) {
        assert!(reader.take(10_000).count() < 10_000);
    }
}

/// CRC-32 bit by bit, so that mutated blocks pass the checksum.
fn crc(parts: &[&[u8]]) -> u32 {
    let mut sum = u32::MAX;
    for byte in parts.iter().flat_map(|part| part.iter()) {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = if sum & 1 == 1 {
                (sum >> 1) ^ 0xedb8_8320
            } else {
                sum >> 1
            };
        }
    }
    !sum
}

fn any_cell() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        4 => (-1000..1000_i32).prop_map(|x| Some(f64::from(x) / 8.0)),
        2 => any::<u64>().prop_map(|bits| Some(f64::from_bits(bits))),
        1 => Just(None),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        read_all(&bytes);
        // Behind a real header.
        let mut file = record(schema(8, TimeBase::Numbered), &rows(3));
        let header = Playback::new(Cursor::new(&file)).unwrap().index().unwrap()[0].offset as usize;
        file.truncate(header);
        file.extend(&bytes);
        read_all(&file);
    }

    #[test]
    fn mutated_files_are_read_or_refused(edits in proptest::collection::vec((any::<u16>(), any::<u8>()), 1..8)) {
        let mut bytes = record(schema(8, TimeBase::Numbered), &rows(40));
        for (place, value) in edits {
            let place = usize::from(place) % bytes.len();
            bytes[place] = value;
        }
        read_all(&bytes);
    }

    /// What a checksum does not stop must not break a decoder either.
    #[test]
    fn mutated_blocks_with_right_checksums_are_total(
        edits in proptest::collection::vec((any::<u16>(), any::<u8>()), 1..6),
        block in 0..5_usize,
        fine in any::<bool>(),
    ) {
        let bound = if fine { Bound::Absolute(1e-9) } else { Bound::Absolute(0.05) };
        let columns = vec![Column::new("a", bound).unwrap(), Column::new("b", Bound::Lossless).unwrap()];
        let schema = Schema::new(columns, TimeBase::Numbered).unwrap().with_rows_per_block(30).unwrap();
        let rows: Vec<_> = rows(150).into_iter().map(|row| vec![row[0], row[0].map(|x| x * 1.1)]).collect();
        let mut bytes = record(schema, &rows);
        let index = Playback::new(Cursor::new(&bytes)).unwrap().index().unwrap();
        let check: [u8; 4] = bytes[index[0].offset as usize - 4..][..4].try_into().unwrap();
        let (start, end) = (index[block].offset as usize, (index[block].offset + index[block].bytes) as usize - 4);
        for (place, value) in edits {
            let place = start + 2 + usize::from(place) % (end - start - 2);
            bytes[place] = value;
        }
        let sum = crc(&[&check, &bytes[start..end]]);
        bytes[end..end + 4].copy_from_slice(&sum.to_le_bytes());
        read_all(&bytes);
    }

    #[test]
    fn arbitrary_cells_return(cells in proptest::collection::vec((any_cell(), any_cell()), 1..80)) {
        let columns = vec![
            Column::new("exact", Bound::Lossless).unwrap(),
            Column::new("near", Bound::Absolute(0.25)).unwrap(),
        ];
        let schema = Schema::new(columns, TimeBase::Numbered).unwrap().with_rows_per_block(32).unwrap();
        let rows: Vec<_> = cells.iter().map(|(a, b)| vec![*a, *b]).collect();
        let restored = read(&record(schema, &rows));
        prop_assert_eq!(restored.len(), rows.len());
        for (row, sample) in restored.iter().zip(&rows) {
            prop_assert_eq!(row.values[0].map(f64::to_bits), sample[0].map(f64::to_bits));
            match (row.values[1], sample[1]) {
                (Some(value), Some(sample)) if sample.is_finite() => {
                    prop_assert!(fewbits_record::is_within(sample, value, 0.25), "{} {}", sample, value);
                }
                (value, sample) => prop_assert_eq!(value.map(f64::to_bits), sample.map(f64::to_bits)),
            }
        }
    }
}
