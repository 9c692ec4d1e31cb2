//! Blocks of few distinct values: a list of the levels, and for each row the number of its level.
//!
//! Many signals take few values that no even grid describes well: decimals that went through single precision, counts in several
//! units, switches. Levels are sorted, so numbers of levels change as smoothly as the samples.
//!
//! ```text
//! models (15 of 16) or counts   number of levels - 1: gamma   lowest level: 64 bits   trailing zeros of all distances: 6 bits
//! distances to the next level without these zeros: length in bits (adaptive), then the bits below the highest
//! first number: its length in bits is that of the number of levels - 1   further numbers: as indices of other blocks
//! ```
//!
//! With tables the arithmetic code has the list alone (from "number of levels" to "distances"). In front of it stands its length in bytes, a
//! varint; behind it are the numbers of all rows as in module `stored` (`learned` in blocks that say so).
//!
//! A level is an index of the block's grid, or a sample itself; both are mapped to unsigned integers of the same order.

use crate::Effort;
use crate::arithmetic::{Coder, Reader, Writer};
use crate::bytes::{Bytes, push_varint};
use crate::counts::{Count, gamma};
use crate::error::{Damaged, ensure};
use crate::indices::code_rest;
use crate::rows::Others;
use crate::stored::{self, Plan};

/// Probability, in units of `2^-16`, that numbers are coded by models.
const BY_MODELS: u32 = 61_440;
/// Largest share of rows that are levels.
const ROWS_PER_LEVEL: usize = 2;
/// Largest number of levels: the models count that many numbers one by one.
const MOST_LEVELS: usize = 1 << 16;
/// Largest number of levels of the fast effort, and how many any rows may have before they are too many for the rows so far.
const FEW_LEVELS: usize = 4096;
const FREE_LEVELS: usize = 128;
/// Lengths of distances, which are contexts of the next one; nodes of the tree of their seven bits.
const LENGTHS: usize = 65;
const NODES: usize = 128;
const TOP: u64 = 1 << 63;

/// Indices as unsigned integers of the same order.
pub(crate) fn key_of_index(index: i64) -> u64 {
    index as u64 ^ TOP
}

pub(crate) fn index_of_key(key: u64) -> i64 {
    (key ^ TOP) as i64
}

/// The bits of a double as an unsigned integer, in the order of the numbers; the negative zero is below zero.
pub(crate) fn key_of_sample(sample: f64) -> u64 {
    let bits = sample.to_bits();
    if bits & TOP == 0 { bits ^ TOP } else { !bits }
}

pub(crate) fn sample_of_key(key: u64) -> f64 {
    f64::from_bits(if key & TOP == 0 { !key } else { key ^ TOP })
}

/// The sorted levels and the number of each row's; `None` if there are too many to be worth a list, or no gaps between them. If `effort` is
/// fast, the list must be short, also beside the rows so far.
pub(crate) fn levels(keys: impl ExactSizeIterator<Item = u64> + Clone, effort: Effort) -> Option<(Vec<u64>, Vec<i64>)> {
    let most = (keys.len() / ROWS_PER_LEVEL).min(MOST_LEVELS);
    let (most, free) = match effort {
        Effort::Thorough => (most, most),
        Effort::Fast => (most.min(FEW_LEVELS), FREE_LEVELS),
    };
    if are_dense(keys.clone()) {
        return None;
    }
    // Number of the level from one on, in the order of the rows; zero is a free slot, of which at least half are.
    let slot_bits = (2 * most + 2).next_power_of_two().ilog2();
    let mut slots = vec![0_u32; 1 << slot_bits];
    let (mut levels, mut numbers) = (Vec::new(), Vec::with_capacity(keys.len()));
    for (row, key) in keys.enumerate() {
        // Multiplied by the golden ratio, whose high bits depend on all bits of the key.
        let mut at = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - slot_bits)) as usize;
        let number = loop {
            match slots[at] {
                0 => {
                    if levels.len() >= (free + row / ROWS_PER_LEVEL).min(most) {
                        return None;
                    }
                    levels.push(key);
                    slots[at] = levels.len() as u32;
                    break levels.len() as u32;
                }
                number if levels[number as usize - 1] == key => break number,
                _ => at = (at + 1) % slots.len(),
            }
        };
        numbers.push(i64::from(number) - 1);
    }
    let mut order: Vec<usize> = (0..levels.len()).collect();
    order.sort_unstable_by_key(|number| levels[*number]);
    let sorted: Vec<u64> = order.iter().map(|number| levels[*number]).collect();
    let mut ranks = vec![0; order.len()];
    order
        .iter()
        .enumerate()
        .for_each(|(rank, number)| ranks[*number] = rank as i64);
    numbers.iter_mut().for_each(|number| *number = ranks[*number as usize]);
    Some((sorted, numbers))
}

/// Whether at least every second key from the lowest to the highest is a level.
fn are_dense(keys: impl ExactSizeIterator<Item = u64> + Clone) -> bool {
    let ends = |(low, high): (u64, u64), key: u64| (low.min(key), high.max(key));
    let (low, high) = keys.clone().fold((u64::MAX, 0), ends);
    let distance = high.saturating_sub(low);
    // There are at most as many levels as keys, of which there is one at least.
    if distance >= 2 * keys.len().max(1) as u64 {
        return false;
    }
    let mut marks = vec![0_u8; distance as usize + 1];
    keys.for_each(|key| marks[(key - low) as usize] = 1);
    let levels: u64 = marks.into_iter().map(u64::from).sum();
    levels < 2 || distance < 2 * levels
}

/// Codes the list of levels: `wanted` at the writer, `None` at the reader.
fn code_levels<C: Coder>(coder: &mut C, wanted: Option<&[u64]>, rows: usize) -> Result<Vec<u64>, Damaged> {
    let count = gamma(coder, wanted.map_or(1, |levels| levels.len() as u64))?;
    ensure!(count <= rows as u64, Damaged::new("levels", count, "at most one per row"));
    let mut level = coder.raw(wanted.map_or(0, |levels| levels[0]), 64);
    let distances = || {
        wanted
            .into_iter()
            .flat_map(|levels| levels.windows(2).map(|pair| pair[1] - pair[0]))
    };
    let zeros = distances().fold(u64::MAX, |zeros, distance| zeros.min(u64::from(distance.trailing_zeros())));
    let zeros = coder.raw(zeros.min(63), 6) as u32;
    let mut counts = vec![[Count::NEW; NODES]; LENGTHS];
    let (mut before, mut levels) = (0, vec![level]);
    for i in 1..count as usize {
        let wanted = wanted.map_or(0, |levels| (levels[i] - levels[i - 1]) >> zeros);
        let length = u64::BITS - wanted.leading_zeros();
        // Bit by bit through a tree of lengths, which are below 128.
        let mut node = 1_usize;
        for bit in (0..7).rev() {
            let up = counts[before][node % NODES].decide(coder, length >> bit & 1 == 1);
            node = 2 * node + usize::from(up);
        }
        let length = (node & 127) as u32;
        ensure!((1..=64).contains(&length), Damaged::new("distance of levels", length, "1 to 64 bits"));
        before = length as usize;
        let distance = 1 << (length - 1) | coder.raw(wanted & !(1 << (length - 1)), length - 1);
        let next = distance.checked_shl(zeros).filter(|next| next >> zeros == distance);
        let next = next.and_then(|distance| level.checked_add(distance));
        let Some(next) = next.filter(|_| !coder.overran()) else {
            return Err(Damaged::new("distance of levels", distance, "a sum below 2^64"));
        };
        level = next;
        levels.push(level);
    }
    Ok(levels)
}

/// Codes the keys of all rows: `wanted` at the writer, `None` at the reader.
pub(crate) fn code<C: Coder>(
    coder: &mut C,
    by_models: bool,
    wanted: Option<&(Vec<u64>, Vec<i64>)>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<u64>, Damaged> {
    let by_models = coder.bit(BY_MODELS, by_models);
    let levels = code_levels(coder, wanted.map(|(levels, _)| levels.as_slice()), rows)?;
    let highest = levels.len() as u64 - 1;
    let first = wanted.map_or(0, |(_, numbers)| numbers[0] as u64);
    let first = coder.raw(first, u64::BITS - highest.leading_zeros()) as i64;
    let numbers = wanted.map(|(_, numbers)| numbers.as_slice());
    let numbers = code_rest(coder, by_models.then_some(false), None, first, numbers, rows, others)?;
    at_numbers(&levels, &numbers)
}

/// The levels of these numbers.
fn at_numbers(levels: &[u64], numbers: &[i64]) -> Result<Vec<u64>, Damaged> {
    let level = |number: &i64| levels.get(usize::try_from(*number).ok()?).copied();
    let levels = numbers.iter().map(level).collect::<Option<_>>();
    levels.ok_or_else(|| Damaged::new("level", "beyond the last one", "one of the list"))
}

/// Appends the code of keys with these levels to the head of a block.
pub(crate) fn write(
    head: Vec<u8>,
    by_models: bool,
    wanted: &(Vec<u64>, Vec<i64>),
    others: Option<&Others<'_>>,
) -> Result<Vec<u8>, Damaged> {
    Writer::all(head, |coder| code(coder, by_models, Some(wanted), wanted.1.len(), others))
}

/// Appends the code of keys with these levels, and tables for their numbers, to the head of a block.
pub(crate) fn write_tabled(
    mut head: Vec<u8>,
    (levels, numbers): &(Vec<u64>, Vec<i64>),
    plan: &Plan,
) -> Result<Vec<u8>, Damaged> {
    let list = Writer::all(Vec::new(), |coder| code_levels(coder, Some(levels), numbers.len()))?;
    push_varint(&mut head, list.len() as u64);
    head.extend_from_slice(&list);
    stored::write(numbers, plan, head)
}

/// The keys of all rows of a block of [`write_tabled`], whose numbers `read` reads.
pub(crate) fn read_tabled(
    bytes: &[u8],
    rows: usize,
    read: fn(&[u8], usize) -> Result<Vec<i64>, Damaged>,
) -> Result<Vec<u64>, Damaged> {
    let mut bytes = Bytes(bytes);
    let length = bytes.count(usize::MAX, "length of levels")?;
    let levels = Reader::all(bytes.take(length)?, |coder| code_levels(coder, None, rows))?;
    at_numbers(&levels, &read(bytes.0, rows)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn keys_have_the_order_of_the_numbers() {
        let samples = [
            f64::NEG_INFINITY,
            -1e300,
            -1.0,
            -5e-324,
            -0.0,
            0.0,
            5e-324,
            1.0,
            f64::MAX,
            f64::INFINITY,
        ];
        for pair in samples.windows(2) {
            assert!(key_of_sample(pair[0]) < key_of_sample(pair[1]), "{pair:?}");
            assert_eq!(sample_of_key(key_of_sample(pair[0])).to_bits(), pair[0].to_bits());
        }
        for index in [i64::MIN, -1, 0, 1, i64::MAX] {
            assert_eq!(index_of_key(key_of_index(index)), index);
        }
    }

    #[test]
    fn levels_return() {
        for distances in [[1, 1 << 62], [7, 3], [1 << 20, 3 << 20], [u64::MAX / 3, u64::MAX / 3]] {
            let list = [5, 5 + distances[0], 5 + distances[0] + distances[1]];
            let keys: Vec<u64> = (0..50).map(|i| list[(i * i) % 3]).collect();
            let Some(found) = levels(keys.iter().copied(), Effort::Thorough) else {
                continue;
            };
            for by_models in [true, false] {
                let bytes = write(vec![], by_models, &found, None).unwrap();
                let read = |bytes: &[u8]| Reader::all(bytes, |coder| code(coder, true, None, keys.len(), None));
                assert_eq!(read(&bytes).unwrap(), keys);
                assert!(read(&bytes[..bytes.len() - 1]).is_err());
            }
        }
        assert!(levels([1, 2, 3, 4].into_iter(), Effort::Thorough).is_none());
    }
}
