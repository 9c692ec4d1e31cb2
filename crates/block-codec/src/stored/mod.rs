//! Codes indices by tables of symbols that the block stores: several times as fast as `counts.rs` for blocks of many rows.
//!
//! Symbols are those of differences, of differences of differences, or of values: indices less a centre. Each context has a table (modules
//! `alphabet` and `weights`). Four lanes code four stretches of rows at a time, each with a state of its own: a processor works on all four
//! at once. Their states and words are those of module `words`.
//!
//! ```text
//! 32 a + 8 m + p varint   a: bytes of the arithmetic code; m: number of words modulo 4; p: pads
//! a bytes                 arithmetic code: first index as in counts; order (2 bits: 0 differences, 1 differences of differences, 2 values);
//!                         k (6 bits); of values their centre, in the form of a first index; tail (4 bits); tables (module `weights`)
//! 4 x 4 bytes             states of the lanes, little-endian
//! words of 2 bytes        little-endian, as the lanes need them
//! ```
//!
//! The rows behind the first one are taken in this order:
//!
//! ```text
//! stretches               four of STRETCH rows side by side as often as they fit before the tail, then four of as many rows as fit
//! tail                    8 * 2^tail rows or all that there are, and the rows that fill no four stretches
//! ```
//!
//! The contexts are those of the beginning at each stretch and at the tail. The tail uses the bits that the states of the lanes still hold:
//! all words in front of the tail are read, the states of the lanes 1 to 3 are `2^16` more than numbers of 16 bits, and the tail reads these
//! three as words before those that are left. Its state is that of lane 0. It begins with `p` words that are zero, and ends with the state 1.

pub(crate) mod alphabet;
mod lane;
mod lanes;
pub(crate) mod order;
mod plan;
#[cfg(test)]
mod tests;
mod weights;
pub(crate) mod words;

use crate::arithmetic::{Coder, Reader, Writer};
use crate::bytes::{Bytes, push_varint};
use crate::error::{Damaged, ensure};
use crate::indices::code_first;
use crate::vectors::narrow;
use lane::Lane;
use lanes::Symbols;
use order::{FIRST, Order, SECOND, VALUES};
pub(crate) use plan::{Plan, pco_order, sample_bits};
use weights::{Entries, Tables};
use words::{HEAD_BITS, LANES, PAD_BITS, STRETCH, Words, stretches};

/// Rows for which memory is reserved in advance, for each word.
const ROWS_OF_A_WORD: usize = 64;
/// Smallest number of rows of a block that is coded by stored tables.
pub(crate) const STORED_ROWS: usize = 1024;
/// Bits that a tail should take: more than the words of three lanes and the state of the first one hold.
const TAIL_BITS: f32 = 80.0;
/// Rows of the smallest tail, and bits of the field of its size.
const TAIL_ROWS: usize = 8;
const TAIL_FIELD: u32 = 4;
/// A tail is doubled while there are more than so many times its rows.
const MOST_TAILS: usize = 8;
/// Mean differences have so many bits above the low ones.
const SIZE_BITS: u32 = 1;
/// Largest number of low bits: differences of differences are at most `2^48` in size.
const MOST_LOW: u32 = 48 - SIZE_BITS;
const LOW_FIELD: u32 = 6;
const ORDER_FIELD: u32 = 2;

/// What is stored before the tables.
#[derive(Debug, Clone, Copy, Default)]
struct Start {
    first: i64,
    order: Order,
    low: u32,
    tail: u32,
}

impl Start {
    /// Codes this start; a reader may be given any.
    fn code<C: Coder>(self, coder: &mut C) -> Result<Self, Damaged> {
        let (first, mut has_rests) = code_first(coder, Some(self.first), false)?;
        let kind = coder.raw(self.order.kind.into(), ORDER_FIELD) as u8;
        ensure!(kind <= VALUES, Damaged::new("order", kind, "0 to 2"));
        let low = coder.raw(self.low.into(), LOW_FIELD) as u32;
        let mut centre = 0;
        if kind == VALUES {
            let (found, rests) = code_first(coder, Some(self.order.centre), false)?;
            (centre, has_rests) = (found, has_rests | rests);
        }
        let expected = "at most 47, behind a first index of at most 2^46 in size";
        ensure!(!has_rests && low <= MOST_LOW, Damaged::new("low bits", low, expected));
        Ok(Self {
            first,
            order: Order { kind, centre },
            low,
            tail: coder.raw(self.tail.into(), TAIL_FIELD) as u32,
        })
    }

    /// Number of rows of all stretches, of so many rows behind the first one.
    fn stretched(&self, rows: usize) -> usize {
        stretches(rows.saturating_sub(TAIL_ROWS << self.tail)).sum::<usize>() * LANES
    }
}

/// A block's indices behind its head. There must be [`STORED_ROWS`] at least.
pub(crate) fn write(indices: &[i64], plan: &Plan, mut bytes: Vec<u8>) -> Result<Vec<u8>, Damaged> {
    let Plan { order, low, bits } = *plan;
    let mut differences = order.differences(indices);
    let rows = differences.len();
    // The smallest tail that has the bits, or the largest one that is not most of the block.
    let mut tail = 0;
    while ((TAIL_ROWS << tail) as f32) * bits < TAIL_BITS && (TAIL_ROWS << tail) * MOST_TAILS < rows {
        tail += 1;
    }
    let start = Start {
        first: indices.first().copied().unwrap_or(0),
        order,
        low,
        tail,
    };
    let stretched = start.stretched(rows);
    let symbols = narrow!(match order.kind {
        VALUES => Symbols::new::<true>(&mut differences, stretched, low),
        _ => Symbols::new::<false>(&mut differences, stretched, low),
    });
    let counts = symbols.counts();
    let tables = narrow!(Tables::of(&counts));
    let stored = Writer::all(Vec::new(), |writer| {
        start.code(writer)?;
        Tables::code(writer, Some(&tables))
    })?;
    let coded = symbols.encoded(&tables, &differences, low);
    let head = (coded.words.len() as u64 % 4) << PAD_BITS | coded.pads;
    push_varint(&mut bytes, (stored.len() as u64) << HEAD_BITS | head);
    bytes.extend_from_slice(&stored);
    bytes.extend(coded.states.iter().flat_map(|state| state.to_le_bytes()));
    bytes.extend(coded.words.iter().rev().flat_map(|word| word.to_le_bytes()));
    Ok(bytes)
}

/// The indices of a block of [`write`], without its head.
pub(crate) fn read(bytes: &[u8], rows: usize) -> Result<Vec<i64>, Damaged> {
    ensure!(rows >= STORED_ROWS, Damaged::new("block", format!("tables for {rows} rows"), "1024 rows or more"));
    let mut bytes = Bytes(bytes);
    let head = bytes.varint()?;
    let stored = bytes.take(usize::try_from(head >> HEAD_BITS).unwrap_or(usize::MAX))?;
    let (start, tables) =
        Reader::all(stored, |reader| Ok::<_, Damaged>((Start::default().code(reader)?, Tables::code(reader, None)?)))?;
    let block = Block {
        start,
        entries: tables.entries(start.order.kind == VALUES),
        head,
    };
    match (start.order.kind, start.low) {
        (VALUES, _) => block.rest::<true, VALUES>(rows, bytes),
        (SECOND, _) => block.rest::<true, SECOND>(rows, bytes),
        (_, 0) => block.rest::<false, FIRST>(rows, bytes),
        (_, _) => block.rest::<true, FIRST>(rows, bytes),
    }
}

/// What is stored before the states.
struct Block {
    start: Start,
    entries: Entries,
    /// Numbers of pads, and of words modulo 4.
    head: u64,
}

impl Block {
    /// All indices.
    fn rest<const LOW_BITS: bool, const ORDER: u8>(&self, rows: usize, bytes: Bytes<'_>) -> Result<Vec<i64>, Damaged> {
        let (mut states, mut words) = Words::begun(bytes, self.head)?;
        // Memory for all rows at once where so few bytes may hold them: a damaged number of rows takes no more than its bytes.
        let mut indices = Vec::with_capacity(rows.min(1 + ROWS_OF_A_WORD * (words.count() + LANES)));
        indices.push(self.start.first);
        let mut found = [0; LANES * STRETCH];
        for length in stretches(self.start.stretched(rows - 1)) {
            let found = &mut found[..LANES * length];
            narrow!(self.stretch::<LOW_BITS, ORDER>(&mut words, &mut states, found));
            words.check(&states)?;
            for found in found.chunks(length) {
                self.start.order.push(&mut indices, found)?;
            }
        }
        let mut lane = Lane::<ORDER>::START;
        let found = words.tail(&states, self.head, rows - indices.len(), |state, words| {
            lane.read::<LOW_BITS>(&self.entries, state, words, self.start.low)
        })?;
        self.start.order.push(&mut indices, &found)?;
        Ok(indices)
    }

    /// The sums of the differences of four stretches, one behind the other.
    #[inline(always)]
    fn stretch<const LOW_BITS: bool, const ORDER: u8>(
        &self,
        words: &mut Words<'_>,
        states: &mut [u32; LANES],
        found: &mut [i64],
    ) {
        // Local variables that nothing else can reach stay in registers.
        let ([mut x0, mut x1, mut x2, mut x3], mut own) = (*states, *words);
        let [mut a, mut b, mut c, mut d] = [Lane::<ORDER>::START; LANES];
        let (entries, low, length) = (&self.entries, self.start.low, found.len() / LANES);
        let (first, second) = found.split_at_mut(2 * length);
        let ((first, second), (third, fourth)) = (first.split_at_mut(length), second.split_at_mut(length));
        for ((p, q), (r, s)) in first.iter_mut().zip(second).zip(third.iter_mut().zip(fourth)) {
            *p = a.read::<LOW_BITS>(entries, &mut x0, &mut own, low);
            *q = b.read::<LOW_BITS>(entries, &mut x1, &mut own, low);
            *r = c.read::<LOW_BITS>(entries, &mut x2, &mut own, low);
            *s = d.read::<LOW_BITS>(entries, &mut x3, &mut own, low);
        }
        (*states, *words) = ([x0, x1, x2, x3], own);
    }
}
