//! Blocks of many rows, written with `Effort::Fast`.

use super::common::mixed;
use fewbits_block_codec::{BlockCodec, Effort};
use proptest::prelude::*;

/// Codes with stored tables: bit 7 of the first byte says that a second one follows, whose bit 7 says so.
fn is_tabled(bytes: &[u8]) -> bool {
    bytes[0] & 0xb0 == 0xb0 && bytes[1] & 0x80 != 0
}

fn fast(delta: f64) -> BlockCodec {
    BlockCodec::new(delta).unwrap().with_effort(Effort::Fast)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]

    #[test]
    fn bound_holds_for_many_rows(seed in any::<u64>(), rows in 1000..5000_usize, exponent in -3..2_i32) {
        let delta = 10.0_f64.powi(exponent);
        let samples = mixed(seed, rows);
        for codec in [fast(delta), fast(delta).on_circle(360.0).unwrap()] {
            let on_circle = codec != fast(delta);
            let start = codec.start(&samples[..100]).unwrap();
            let started = codec.encode_from(&start, &samples, &[]).unwrap();
            for values in [
                codec.decode(&codec.encode(&samples).unwrap(), rows).unwrap(),
                codec.decode_from(&start, &started.bytes, rows, &[]).unwrap(),
            ] {
                for (value, sample) in values.iter().zip(&samples) {
                    let distance = (value - if on_circle { sample.rem_euclid(360.0) } else { *sample }).abs();
                    let distance = if on_circle { distance.min(360.0 - distance) } else { distance };
                    prop_assert!(distance <= delta);
                }
            }
        }
    }

    #[test]
    fn any_bytes_behind_a_head_of_tables_are_total(bytes in prop::collection::vec(any::<u8>(), 0..300), rows in 2048..9000_usize) {
        // Tables that learn, stored ones, and sections.
        for head in [[0xb0 | 13, 0x40], [0xb0 | 13, 0x80], [0x8f, 0xc0]] {
            let block = [head.as_slice(), bytes.as_slice()].concat();
            if let Ok(values) = fast(0.1).decode(&block, rows) {
                prop_assert_eq!(values.len(), rows);
            }
        }
    }
}

/// Columns of many rows that no grid, or only the last one, suits: each returns within the bound or to the last bit.
#[test]
fn wild_columns_of_many_rows_return() {
    let mixed = mixed(9, 2600);
    let wild: [fn(usize, f64) -> f64; 12] = [
        |_, _| f64::NAN,
        |_, _| 7.0,
        |row, x| if row % 3 == 0 { f64::INFINITY } else { x },
        |row, x| if row % 700 == 0 { f64::NEG_INFINITY } else { x },
        |row, x| if row % 2 == 0 { -0.0 } else { x.floor() * 0.0 },
        |row, _| f64::from_bits(row as u64 % 5),
        |row, _| 9_223_372_036_854_775_808.0 - 2048.0 * (row % 7) as f64,
        |row, _| f64::MAX * if row % 50 < 25 { 1.0 } else { -1.0 },
        |row, x| x + 1e9 * (row / 500) as f64,
        |row, x| (x * 1e-3).exp() * 10.0_f64.powi((row % 600) as i32 - 300),
        |row, x| if row < 2500 { 1.0 } else { x },
        |row, _| (row as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) as f64,
    ];
    for (kind, wild) in wild.iter().enumerate() {
        let samples: Vec<f64> = mixed.iter().enumerate().map(|(row, x)| wild(row, *x)).collect();
        for codec in [
            fast(1e-3),
            fast(40.0),
            fast(1e300),
            BlockCodec::lossless().with_effort(Effort::Fast),
        ] {
            for rows in [1024, 1025, 1027, 2600] {
                let bytes = codec.encode(&samples[..rows]).unwrap();
                assert!(bytes.len() <= 9 * rows + 300, "{kind}: {}", bytes.len());
                let values = codec.decode(&bytes, rows).unwrap();
                let bound = [1e-3, 40.0, 1e300]
                    .into_iter()
                    .find(|bound| fast(*bound) == codec)
                    .unwrap_or(0.0);
                assert!(
                    values
                        .iter()
                        .zip(&samples)
                        .all(|(value, sample)| value.to_bits() == sample.to_bits()
                            || (bound > 0.0 && (value - sample).abs() <= bound)),
                    "{kind}, {rows} rows, {codec:?}"
                );
            }
        }
    }
}

#[test]
fn blocks_of_many_rows_have_tables() {
    let samples = mixed(3, 4000);
    assert!(is_tabled(&fast(0.05).encode(&samples).unwrap()));
    assert!(!is_tabled(&fast(0.05).encode(&samples[..1023]).unwrap()));
    assert!(!is_tabled(&BlockCodec::new(0.05).unwrap().encode(&samples).unwrap()));
    let rests: Vec<f64> = (0..4000).map(|row| f64::from(row / 400)).collect();
    assert!(fast(0.05).encode(&rests).unwrap().len() < 64);
}

#[test]
fn damaged_tables_give_the_stated_rows_or_an_error() {
    let samples = mixed(5, 2100);
    let bytes = fast(0.05).encode(&samples).unwrap();
    assert!(is_tabled(&bytes));
    for flag in [0x80, 0x10, 0x20] {
        let damaged = [&[bytes[0] ^ flag], &bytes[1..]].concat();
        assert!(fast(0.05).decode(&damaged, 2100).is_err(), "{flag}");
    }
    let shortened = (0..bytes.len()).map(|end| bytes[..end].to_vec());
    let flipped = (0..8 * bytes.len()).map(|bit| {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        flipped
    });
    for damaged in shortened.chain(flipped) {
        if let Ok(values) = fast(0.05).decode(&damaged, 2100) {
            assert_eq!(values.len(), 2100);
        }
    }
    for rows in [1, 1023, 2099, 2101, 1 << 40, usize::MAX] {
        assert!(fast(0.05).decode(&bytes, rows).is_err(), "{rows}");
    }
}

/// Numbers that are on no grid of decimals.
fn uneven(rows: usize) -> Vec<f64> {
    let samples = mixed(11, rows);
    samples
        .iter()
        .map(|x| (x * 8.0).round().rem_euclid(40.0).sqrt())
        .collect()
}

/// A list of levels with tables: bit 7 of the first byte says that a second one follows, whose bit 7 says so.
fn has_tabled_levels(bytes: &[u8]) -> bool {
    [0x20, 0].contains(&(bytes[0] & 0x30)) && bytes[0] & 0x80 != 0 && bytes[1] & 0x80 != 0
}

/// Blocks of the corpus of recordings whose tables learn: no writer makes them.
#[test]
fn learned_tables_are_read_and_damage_is_total() {
    let coarse = |bound| BlockCodec::new(bound).unwrap();
    for (bytes, codec) in [
        (&include_bytes!("learned-differences.bin")[..], coarse(2.0)),
        (include_bytes!("learned-values.bin"), coarse(16.0)),
        (include_bytes!("learned-levels.bin"), BlockCodec::lossless()),
    ] {
        assert_eq!(codec.decode(bytes, 5000).unwrap().len(), 5000);
        for rows in [1, 2047, 4999, 5001, 1 << 40, usize::MAX] {
            assert!(codec.decode(bytes, rows).is_err(), "{rows}");
        }
        for bit in (0..8 * bytes.len()).step_by(11) {
            let mut flipped = bytes.to_vec();
            flipped[bit / 8] ^= 1 << (bit % 8);
            for damaged in [&flipped, &bytes[..bit / 8]] {
                if let Ok(values) = codec.decode(damaged, 5000) {
                    assert_eq!(values.len(), 5000);
                }
            }
        }
    }
}

#[test]
fn few_uneven_levels_have_a_list_and_tables() {
    let samples = uneven(3000);
    for codec in [BlockCodec::lossless(), BlockCodec::new(1e-9).unwrap()] {
        let bytes = codec.with_effort(Effort::Fast).encode(&samples).unwrap();
        assert!(has_tabled_levels(&bytes), "{:?}", &bytes[..2]);
        let thorough = codec.encode(&samples).unwrap().len();
        assert!(bytes.len() < thorough * 5 / 4, "{} for {thorough}", bytes.len());
        let read = codec.decode(&bytes, 3000).unwrap();
        assert!(
            read.iter()
                .zip(&samples)
                .all(|(value, sample)| (value - sample).abs() <= 1e-9)
        );
        // Bit 6 of the first byte would say that other columns are needed; nobody writes it beside tables.
        let joint = [&[bytes[0] | 0x40], &bytes[1..]].concat();
        assert!(codec.decode_with(&joint, 3000, &[&samples]).is_err());
        for damaged in (0..8 * bytes.len()).step_by(5).map(|bit| {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            flipped
        }) {
            if let Ok(values) = codec.decode(&damaged, 3000) {
                assert_eq!(values.len(), 3000);
            }
        }
        for rows in [1, 1023, 2999, 3001, usize::MAX] {
            assert!(codec.decode(&bytes, rows).is_err(), "{rows}");
        }
    }
}

/// Each signal beside the coding that suits it, at bounds from coarse to lossless.
#[test]
fn the_chosen_coding_is_little_longer_than_the_default() {
    let walk = mixed(4, 8000);
    let draws: Vec<f64> = (0..8000_u64)
        .map(|row| (row.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) as f64 / 64.0)
        .collect();
    let peaks: Vec<f64> = draws.iter().map(|x| if x.fract() < 0.8 { 100.0 } else { *x }).collect();
    for (name, samples) in [
        ("walk", &walk),
        ("draws", &draws),
        ("peaks", &peaks),
        ("uneven", &uneven(8000)),
    ] {
        for codec in [0.5, 0.02, 1e-4]
            .map(|bound| BlockCodec::new(bound).unwrap())
            .into_iter()
            .chain([BlockCodec::lossless()])
        {
            let thorough = codec.encode(samples).unwrap().len();
            let fast = codec.with_effort(Effort::Fast).encode(samples).unwrap().len();
            assert!(fast <= thorough * 5 / 4 + 32, "{name}, {codec:?}: {fast} for {thorough}");
        }
    }
}

/// Signals of several kinds one behind the other: each has a section, whose bits it would need alone.
#[test]
fn a_signal_that_changes_its_kind_has_sections() {
    let noise = |row: usize| (row.wrapping_mul(2_654_435_761) >> 16) % 4001;
    let kinds: [fn(usize, f64) -> f64; 4] = [
        |row, _| (row as f64 / 300.0).sin() * 50.0,
        |_, noise| (noise / 40.0).floor() / 10.0,
        |row, noise| (row / 900) as f64 + if noise < 3.0 { 1.0 } else { 0.0 },
        |_, noise| noise * noise * 0.001,
    ];
    let parts: Vec<Vec<f64>> = kinds
        .iter()
        .map(|kind| (0..6144).map(|row| kind(row, noise(row) as f64)).collect())
        .collect();
    let samples = parts.concat();
    for codec in [fast(0.05), BlockCodec::lossless().with_effort(Effort::Fast)] {
        let bytes = codec.encode(&samples).unwrap();
        let alone: usize = parts.iter().map(|part| codec.encode(part).unwrap().len()).sum();
        assert_eq!(bytes[..2], [0x8f, 0xc0]);
        assert!(bytes.len() < alone + alone / 50 + 64, "{} {alone}", bytes.len());
        let values = codec.decode(&bytes, samples.len()).unwrap();
        let delta = if codec == fast(0.05) { 0.05 } else { 0.0 };
        assert!(
            values
                .iter()
                .zip(&samples)
                .all(|(value, sample)| (value - sample).abs() <= delta)
        );
        for rows in [1, 6144, samples.len() - 1, samples.len() + 1] {
            assert!(codec.decode(&bytes, rows).is_err(), "{rows}");
        }
        for length in (0..64).chain(bytes.len() - 64..bytes.len()) {
            assert!(codec.decode(&bytes[..length], samples.len()).is_err(), "{length}");
        }
        // Sections have none of their own.
        let nested = [&[0x8f, 0xc0, 0], bytes.as_slice()].concat();
        assert!(codec.decode(&nested, samples.len()).is_err());
    }
    let one = mixed(3, 20_000);
    assert_ne!(fast(0.5).encode(&one).unwrap()[0], 0x8f, "a signal of one kind has no sections");
}
