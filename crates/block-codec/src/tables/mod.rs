//! Codes indices by tables of symbols: several times as fast as `counts.rs` for blocks of many rows.
//!
//! The first [`WARM`] differences are coded by counts. All further ones are symbols (module `symbols`) under tables that both ends make
//! anew from the symbols so far, so that no table is stored. Four lanes code four stretches of rows at a time, each with a state of its
//! own (module `words`): a processor works on all four at once.
//!
//! ```text
//! 32 w + 8 m + p varint   w: bytes of the arithmetic code; m: number of words modulo 4; p: pads
//! w bytes                 arithmetic code: first index and second differences or not, as in counts; k (6 bits); WARM differences by counts
//! 4 x 4 bytes             states of the lanes, little-endian
//! words of 2 bytes        little-endian, as the lanes need them
//! ```
//!
//! Order of the remaining rows, whose number is `r`:
//!
//! ```text
//! tail                    t = 80 * WARM / 8w rows, at least 8 and at most 8 + r / 16, all other rows are stretches
//! stretches               four of STRETCH rows side by side as often as they fit, then four of as many rows as fit; what is left joins the tail
//! after each four         contexts are those of the beginning
//! after PERIOD rows of each lane   tables are made anew where they are due
//! ```
//!
//! The tail uses the bits that the states of the lanes still hold: all words in front of the tail are read, the states of the lanes 1 to 3
//! are `2^16` more than numbers of 16 bits, and the tail reads these three as words before those that are left. Its state is that of lane
//! 0. It begins with `p` words that are zero, has no new tables, reads words only while there are any, and ends with the state 1.

mod symbols;
#[cfg(test)]
mod tests;
mod words;

use crate::arithmetic::{Coder, Reader, Writer};
use crate::bytes::{Bytes, push_varint};
use crate::counts::Counts;
use crate::error::Damaged;
use crate::indices::code_first;
use crate::rows::{LARGEST, code_all, damaged};
use crate::vectors::vectorised_narrow;
use symbols::{Context, Tables};
use words::{LANES, LOW, Steps, Words};

/// Number of differences that are coded by counts.
const WARM: usize = 256;
/// Rows of a stretch.
const STRETCH: usize = 512;
/// Rows of each lane between two looks at the tables.
const PERIOD: usize = 32;
/// Smallest number of rows of a block that is coded by tables.
pub(crate) const TABLES_ROWS: usize = 2048;
const _: () = assert!(TABLES_ROWS > WARM + 1);
/// Bits that a tail should take: more than the words of three lanes and the state of the first one hold.
const TAIL_BITS: usize = 80;
/// Mean differences have so many bits above the low ones.
const SIZE_BITS: u32 = 3;
/// Largest number of low bits: differences of differences are at most `2^48` in size.
const MOST_LOW: u32 = 48 - SIZE_BITS;
const LOW_FIELD: u32 = 6;
/// Bits of the number of pads (words of three lanes and the state of the first one), and of that and the number of words modulo 4. Without
/// the latter, a word too many or too few is rarely taken for a part of other rows.
const PAD_BITS: u32 = 3;
const HEAD_BITS: u32 = PAD_BITS + 2;

/// Number of rows of the tail at least.
fn tail_rows(rows: usize, warm_bytes: usize) -> usize {
    (TAIL_BITS * WARM / (8 * warm_bytes.max(1)))
        .clamp(8, 8 + rows / 16)
        .min(rows)
}

/// Lengths of the stretches that four lanes take at a time.
fn stretches(rows: usize) -> impl Iterator<Item = usize> {
    let full = rows / (LANES * STRETCH);
    let rest = (rows - full * LANES * STRETCH) / LANES;
    std::iter::repeat_n(STRETCH, full).chain((rest > 0).then_some(rest))
}

/// Differences of indices, or of their differences.
struct Differences {
    second: bool,
    last: i64,
    slope: i64,
}

impl Differences {
    fn new(first: i64, second: bool) -> Self {
        Self {
            second,
            last: first,
            slope: 0,
        }
    }

    #[inline(always)]
    fn next(&mut self, index: i64) -> i64 {
        let slope = index - self.last;
        let before = std::mem::replace(&mut self.slope, slope);
        self.last = index;
        slope - if self.second { before } else { 0 }
    }

    /// The index of a difference, the inverse of [`next`](Self::next).
    #[inline(always)]
    fn index(&mut self, difference: i64) -> i64 {
        self.slope = difference + if self.second { self.slope } else { 0 };
        self.last += self.slope;
        self.last
    }
}

/// A block's indices behind its head. There must be [`TABLES_ROWS`] at least.
pub(crate) fn write(indices: &[i64], mut bytes: Vec<u8>) -> Result<Vec<u8>, Damaged> {
    let second = Counts::prefers_second(indices);
    let mut differences = Differences::new(indices[0], second);
    let all: Vec<i64> = indices[1..].iter().map(|index| differences.next(*index)).collect();
    let sum: u128 = all.iter().map(|d| u128::from(d.unsigned_abs())).sum();
    let mean = (sum / all.len() as u128) as u64;
    let low = mean.checked_ilog2().map_or(0, |bits| bits.saturating_sub(SIZE_BITS));
    let mut writer = Writer::default();
    code_first(&mut writer, indices.first().copied(), false)?;
    writer.raw(u64::from(second), 1);
    writer.raw(u64::from(low), LOW_FIELD);
    code_all(&mut writer, Counts::new(indices[0], second), Some(&indices[..=WARM]), WARM + 1, None)?;
    let warm = writer.finish();
    let (learned, rest) = all.split_at(WARM);
    let tail = tail_rows(rest.len(), warm.len());
    let (steps, tail_from) = vectorised_narrow(
        #[inline(always)]
        || steps(learned, rest, low, tail),
    );
    let (states, words, pads) = steps.encoded(tail_from);
    let head = (words.len() as u64 % 4) << PAD_BITS | pads;
    push_varint(&mut bytes, (warm.len() as u64) << HEAD_BITS | head);
    bytes.extend_from_slice(&warm);
    bytes.extend(states.iter().flat_map(|state| state.to_le_bytes()));
    bytes.extend(words.iter().rev().flat_map(|word| word.to_le_bytes()));
    Ok(bytes)
}

/// The steps of all rows in the order of a reader, and which is the first of the tail.
#[inline(always)]
fn steps(learned: &[i64], rest: &[i64], low: u32, tail: usize) -> (Steps, usize) {
    let mut tables = Tables::learned::<false>(learned, low);
    let mut steps = Steps::with_capacity(rest.len() + rest.len() / 8);
    let mut remaining = rest;
    for length in stretches(rest.len() - tail) {
        let mut lanes = [Context::START; LANES];
        let (rows, others) = remaining.split_at(LANES * length);
        remaining = others;
        for from in (0..length).step_by(PERIOD) {
            for row in from..length.min(from + PERIOD) {
                for (lane, context) in lanes.iter_mut().enumerate() {
                    tables.write(context, rows[lane * length + row], low, |part| steps.push(lane, part));
                }
            }
            tables.renew::<false>();
        }
    }
    let (tail_from, mut context) = (steps.len(), Context::START);
    for difference in remaining {
        tables.write(&mut context, *difference, low, |part| steps.push(0, part));
    }
    (steps, tail_from)
}

/// The indices of a block of [`write`], without its head.
pub(crate) fn read(bytes: &[u8], rows: usize) -> Result<Vec<i64>, Damaged> {
    if rows < TABLES_ROWS {
        return Err(Damaged::new("block", format!("tables for {rows} rows"), "2048 rows or more"));
    }
    let mut bytes = Bytes(bytes);
    let head = bytes.varint()?;
    let warm = bytes.take(usize::try_from(head >> HEAD_BITS).unwrap_or(usize::MAX))?;
    let mut reader = Reader::new(warm);
    let (first, rests) = code_first(&mut reader, None, false)?;
    let second = reader.raw(0, 1) == 1;
    let low = reader.raw(0, LOW_FIELD) as u32;
    if rests || low > MOST_LOW {
        return Err(Damaged::new("low bits", low, "at most 45, behind a first index of at most 2^46 in size"));
    }
    let indices = code_all(&mut reader, Counts::new(first, second), None, WARM + 1, None)?;
    reader.finish()?;
    let start = Head {
        second,
        low,
        pads: head & ((1 << PAD_BITS) - 1),
        words: head >> PAD_BITS & 3,
        tail: tail_rows(rows - 1 - WARM, warm.len()),
    };
    if low == 0 {
        start.rest::<false>(indices, rows, bytes)
    } else {
        start.rest::<true>(indices, rows, bytes)
    }
}

/// What is stored before the symbols.
struct Head {
    second: bool,
    low: u32,
    pads: u64,
    /// Number of words modulo 4.
    words: u64,
    tail: usize,
}

impl Head {
    /// All indices; `indices` are those of the arithmetic code.
    fn rest<const LOW_BITS: bool>(
        &self,
        mut indices: Vec<i64>,
        rows: usize,
        mut bytes: Bytes<'_>,
    ) -> Result<Vec<i64>, Damaged> {
        let cut_off = || Damaged::new("block", "other words", "those that a writer of as many rows wrote");
        let mut differences = Differences::new(indices[0], self.second);
        let learned: Vec<i64> = indices[1..].iter().map(|index| differences.next(*index)).collect();
        let mut states = [0; LANES];
        for state in &mut states {
            *state = u32::from_le_bytes(bytes.array()?);
        }
        let (words, odd) = bytes.0.as_chunks();
        if !odd.is_empty() || words.len() as u64 % 4 != self.words {
            return Err(cut_off());
        }
        let mut words = Words::new(words);
        let mut tables = Tables::learned::<true>(&learned, self.low);
        let mut found = [0; LANES * STRETCH];
        let rest = rows - indices.len();
        for length in stretches(rest - self.tail) {
            let found = &mut found[..LANES * length];
            vectorised_narrow(
                #[inline(always)]
                || self.stretch::<LOW_BITS>(&mut tables, &mut words, &mut states, found),
            );
            // Checked here, so that time and memory are in proportion to the bytes.
            if words.is_broken() || states.iter().any(|state| *state < LOW) {
                return Err(cut_off());
            }
            push_indices(&mut indices, &mut differences, found)?;
        }
        let (first, others) = (states[0], &states[1..]);
        if others.iter().any(|state| *state >= 2 * LOW) {
            return Err(cut_off());
        }
        let late = words.behind(others.iter().map(|state| *state as u16));
        let (mut words, mut state) = (Words::new(&late), first);
        let pads = (0..self.pads).fold(0, |all, _| all | words.raw(&mut state, 16));
        let mut context = Context::START;
        let found: Vec<i64> = (indices.len()..rows)
            .map(|_| tables.read::<LOW_BITS>(&mut context, &mut state, &mut words, self.low))
            .collect();
        push_indices(&mut indices, &mut differences, &found)?;
        if pads != 0 || words.is_broken() || !words.is_finished() || state != 1 {
            return Err(cut_off());
        }
        Ok(indices)
    }

    /// The differences of four stretches, one behind the other.
    #[inline(always)]
    fn stretch<const LOW_BITS: bool>(
        &self,
        tables: &mut Tables,
        words: &mut Words<'_>,
        states: &mut [u32; LANES],
        found: &mut [i64],
    ) {
        // Local variables that nothing else can reach stay in registers.
        let [mut x0, mut x1, mut x2, mut x3] = *states;
        let [mut c0, mut c1, mut c2, mut c3] = [Context::START; LANES];
        let length = found.len() / LANES;
        let (a, b) = found.split_at_mut(2 * length);
        let ((a, b), (c, d)) = (a.split_at_mut(length), b.split_at_mut(length));
        let first = a.chunks_mut(PERIOD).zip(b.chunks_mut(PERIOD));
        let second = c.chunks_mut(PERIOD).zip(d.chunks_mut(PERIOD));
        for ((a, b), (c, d)) in first.zip(second) {
            for ((a, b), (c, d)) in a.iter_mut().zip(b).zip(c.iter_mut().zip(d)) {
                *a = tables.read::<LOW_BITS>(&mut c0, &mut x0, words, self.low);
                *b = tables.read::<LOW_BITS>(&mut c1, &mut x1, words, self.low);
                *c = tables.read::<LOW_BITS>(&mut c2, &mut x2, words, self.low);
                *d = tables.read::<LOW_BITS>(&mut c3, &mut x3, words, self.low);
            }
            tables.renew::<true>();
        }
        *states = [x0, x1, x2, x3];
    }
}

/// Appends the indices of these differences.
fn push_indices(indices: &mut Vec<i64>, differences: &mut Differences, found: &[i64]) -> Result<(), Damaged> {
    indices.reserve(found.len());
    for difference in found {
        let index = differences.index(*difference);
        if index.abs() > LARGEST {
            return Err(damaged(index));
        }
        indices.push(index);
    }
    Ok(())
}
