//! Round trips and damage, on indices directly: through the public interface large differences would be coded by pco.

#![allow(clippy::unwrap_used)]

use super::plan::coded;
use super::*;
use crate::rows::LARGEST;
use proptest::prelude::*;

/// Stretches of rest, walk, steps of one size, and jumps up to the largest index.
fn pieces() -> impl Strategy<Value = Vec<i64>> {
    let piece = (0..5_u8, 0..=46_u32, any::<u64>(), 1..900_usize);
    prop::collection::vec(piece, 3..8).prop_map(|pieces| {
        let mut indices = vec![0_i64];
        for (kind, bits, seed, rows) in pieces.iter().copied().cycle().take(40) {
            let mut state = seed | 1;
            for _ in 0..rows {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let random = (state >> 16) as i64 & ((1 << bits) - 1).max(1);
                let last = indices[indices.len() - 1];
                let next = match kind {
                    0 => last,
                    1 => last + (state >> 62) as i64 - 1,
                    2 => last + random - (1 << bits) / 2,
                    3 => last + (1 << bits) * ((state >> 63) as i64 * 2 - 1),
                    _ => random * ((state >> 63) as i64 * 2 - 1),
                };
                indices.push(next.clamp(-LARGEST, LARGEST - 1));
            }
            if indices.len() > STORED_ROWS + 600 {
                break;
            }
        }
        indices.truncate(5000);
        let rows = indices.len().max(STORED_ROWS);
        indices.resize(rows, 7);
        indices
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    #[test]
    fn indices_return_and_other_lengths_are_refused(indices in pieces(), order in 0..3_u8, centre in -LARGEST..=LARGEST) {
        let order = Order { kind: order, centre };
        let plan = Plan::of(&coded(order, &indices));
        let bytes = write(&indices, &plan, Vec::new()).unwrap();
        prop_assert!(read(&bytes, indices.len()).unwrap() == indices);
        for more in 1..8 {
            prop_assert!(read(&[bytes.as_slice(), &vec![0; more]].concat(), indices.len()).is_err());
            prop_assert!(read(&bytes[..bytes.len() - more], indices.len()).is_err());
        }
        prop_assert!(read(&bytes, usize::MAX).is_err());
    }

    #[test]
    fn damaged_bytes_give_the_stated_rows_or_an_error(
        indices in pieces(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        rows in prop_oneof![Just(None), (STORED_ROWS..20_000).prop_map(Some)],
    ) {
        let mut bytes = write(&indices, &Plan::new(&indices), Vec::new()).unwrap();
        let rows = rows.unwrap_or(indices.len());
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(found) = read(&bytes, rows) {
            prop_assert_eq!(found.len(), rows);
        }
    }

    #[test]
    fn any_bytes_give_the_stated_rows_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400), rows in 0..6000_usize) {
        if let Ok(found) = read(&bytes, rows) {
            prop_assert_eq!(found.len(), rows);
        }
    }
}

/// Differences of each size, of both signs, alone and in turn.
#[test]
fn differences_of_every_size_return() {
    for bits in 0..=46 {
        let size = (1_i64 << bits).min(LARGEST - 1);
        for rare in [1, 2, 97] {
            let sign = |row: i64| if row / rare % 2 == 0 { size } else { -size };
            let indices: Vec<i64> = (0..2100)
                .map(|row| if row % rare == 0 { sign(row) } else { 0 })
                .collect();
            let bytes = write(&indices, &Plan::new(&indices), Vec::new()).unwrap();
            assert!(read(&bytes, indices.len()).unwrap() == indices, "2^{bits}, every {rare}");
        }
    }
}

/// A reader that meets the end of the words, or states that no writer writes, stops at the next stretch.
#[test]
fn stated_rows_take_no_memory_that_the_bytes_do_not_fill() {
    let indices = vec![5; STORED_ROWS];
    let bytes = write(&indices, &Plan::new(&indices), Vec::new()).unwrap();
    assert!(bytes.len() < 40, "{}", bytes.len());
    for rows in [STORED_ROWS + 1, 1 << 20, 1 << 40, usize::MAX] {
        assert!(read(&bytes, rows).is_err(), "{rows}");
    }
    // States below the smallest one never take up bits and are refused.
    let at = bytes.len() - bytes.len() % 2 - 16;
    let mut low = bytes;
    low[at..].fill(0);
    assert!(read(&low, STORED_ROWS).is_err());
}

/// The states at the end of the stretches have redundancy; only the last words, which the tail reads, have none.
#[test]
fn hardly_a_flipped_bit_behind_the_tables_is_accepted() {
    let indices: Vec<i64> = (0..3000_u64)
        .map(|row| (((row * row * 2_654_435_761) >> 20) & 7) as i64)
        .collect();
    let bytes = write(&indices, &Plan::new(&indices), Vec::new()).unwrap();
    let mut reader = Bytes(&bytes);
    let stored = (reader.varint().unwrap() >> HEAD_BITS) as usize;
    let from = bytes.len() - reader.0.len() + stored;
    let accepted = (8 * from..8 * bytes.len()).filter(|bit| {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        read(&flipped, indices.len()).is_ok()
    });
    let (accepted, all) = (accepted.count(), 8 * (bytes.len() - from));
    assert!(200 * accepted < all, "{accepted} of {all}");
}

/// Independent draws of known probabilities: the entropy bounds every code from below.
#[test]
fn independent_symbols_take_little_more_than_their_entropy() {
    let mut state = 1_u64;
    let mut draw = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let rows = 40_000;
    for up in [0.02, 0.2, 0.45] {
        let mut index = 0_i64;
        let mut indices = vec![0];
        indices.extend((1..rows).map(|_| {
            let u = draw();
            index += i64::from(u < up) - i64::from(u > 1.0 - up);
            index
        }));
        let entropy = -2.0 * up * up.log2() - (1.0 - 2.0 * up) * (1.0 - 2.0 * up).log2();
        let bits = 8.0 * write(&indices, &Plan::new(&indices), Vec::new()).unwrap().len() as f64 / rows as f64;
        assert!(bits > 0.98 * entropy && bits < 1.03 * entropy, "{up}: {bits} for {entropy}");
    }
}

/// Independent values have differences of more entropy than themselves.
#[test]
fn values_without_memory_are_coded_as_values() {
    let mut state = 7_u64;
    let indices: Vec<i64> = (0..20_000)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            1000 + (state >> 40) as i64 % 12
        })
        .collect();
    let plan = Plan::new(&indices);
    assert_eq!(plan.order.kind, VALUES, "{plan:?}");
    let bits = 8.0 * write(&indices, &plan, Vec::new()).unwrap().len() as f64 / 20_000.0;
    assert!(bits < 1.02 * 12.0_f64.log2(), "{bits}");
    assert!((f64::from(plan.bits) / bits - 1.0).abs() < 0.1, "{plan:?} for {bits}");
}

/// A state is divided by the width of a symbol with the quotient that division has, next to each multiple and at both ends.
#[test]
fn quotients_by_reciprocals_are_exact() {
    for width in 1..=weights::SLOTS as u64 {
        let limit = width << (32 - weights::SLOT_BITS);
        let near = [1, 2, 3, limit / width / 2, limit / width - 1, limit / width].map(|factor| factor * width);
        for x in near.into_iter().flat_map(|x| [x - 1, x, x + 1]).filter(|x| *x < limit) {
            assert_eq!(lanes::quotient(x as u32, width as u32), (x / width) as u32, "{x} by {width}");
        }
    }
}

/// Tables for counts of every shape return, and fill their slots.
#[test]
fn tables_return() {
    for seed in 1..200_u32 {
        let mut counts = [[0; alphabet::SYMBOLS]; alphabet::CONTEXTS];
        for (at, count) in counts.as_flattened_mut().iter_mut().enumerate() {
            let random = (at as u32 + 1).wrapping_mul(seed).wrapping_mul(2_654_435_761) >> 8;
            *count = if random % 64 < seed % 60 {
                (random >> 6) >> (seed % 17)
            } else {
                0
            };
        }
        let tables = Tables::of(&counts);
        let mut writer = Writer::default();
        Tables::code(&mut writer, Some(&tables)).unwrap();
        let bytes = writer.finish();
        assert_eq!(Tables::code(&mut Reader::new(&bytes), None).unwrap(), tables);
        for (widths, counts) in tables.widths().zip(&counts) {
            assert_eq!(widths.iter().sum::<u32>() as usize, weights::SLOTS);
            assert!(
                widths
                    .iter()
                    .zip(counts)
                    .all(|(width, count)| *width > 0 || *count == 0)
            );
        }
    }
}
