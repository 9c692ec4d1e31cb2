//! Reads indices that were coded by tables of symbols which learn. Writers store tables (module `stored`), which are read twice as fast.
//!
//! The first [`WARM`] differences are coded by counts. All further ones are symbols (module `alphabet`) under tables that both ends make
//! anew from the symbols so far, so that no table is stored. Four lanes code four stretches of rows at a time, each with a state of its
//! own (module `words`): a processor works on all four at once. Symbols are those of differences, of differences of differences, or of
//! values: indices less a centre, for which `k` is at most 15. Of values, too, the first differences are coded by counts.
//!
//! ```text
//! 32 w + 8 m + p varint   w: bytes of the arithmetic code; m: number of words modulo 4; p: pads
//! w bytes                 arithmetic code: first index and second differences or not, as in counts; k (6 bits; from 48 on: 48 less, of values,
//!                         followed by their centre in the form of a first index); WARM differences by counts
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

mod alphabet;
pub(crate) mod order;
mod symbols;
pub(crate) mod words;

use crate::arithmetic::{Coder, Reader};
use crate::bytes::Bytes;
use crate::counts::Counts;
use crate::error::Damaged;
use crate::indices::code_first;
use crate::rows::code_all;
use crate::vectors::vectorised_narrow;
use alphabet::Context;
use order::Order;
use symbols::Tables;
use words::{LANES, LOW, Words};

/// Number of differences that are coded by counts.
const WARM: usize = 256;
/// Rows of a stretch.
const STRETCH: usize = 512;
/// Rows of each lane between two looks at the tables.
const PERIOD: usize = 32;
/// Rows for which memory is reserved in advance, for each word.
const ROWS_OF_A_WORD: usize = 64;
/// Smallest number of rows of a block that is coded by tables.
const TABLES_ROWS: usize = 2048;
const _: () = assert!(TABLES_ROWS > WARM + 1);
/// Bits that a tail should take: more than the words of three lanes and the state of the first one hold.
const TAIL_BITS: usize = 80;
/// Mean differences have so many bits above the low ones.
const SIZE_BITS: u32 = 3;
/// Largest number of low bits: differences of differences are at most `2^48` in size.
const MOST_LOW: u32 = 48 - SIZE_BITS;
const LOW_FIELD: u32 = 6;
/// Numbers of low bits from here on say that values are coded, of fewer low bits.
const OF_VALUES: u32 = 48;
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

/// The indices of a block without its head.
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
    let mut low = reader.raw(0, LOW_FIELD) as u32;
    let mut order = if second { Order::Second } else { Order::First };
    let mut has_rests = rests;
    if low >= OF_VALUES {
        let (centre, rests) = code_first(&mut reader, None, false)?;
        (order, low, has_rests) = (Order::Values { centre }, low - OF_VALUES, has_rests || rests || second);
    }
    if has_rests || low > MOST_LOW {
        let expected = "at most 45, or of values, behind a first index of at most 2^46 in size";
        return Err(Damaged::new("low bits", low, expected));
    }
    let indices = code_all(&mut reader, Counts::new(first, second), None, WARM + 1, None)?;
    reader.finish()?;
    let start = Head {
        order,
        low,
        pads: head & ((1 << PAD_BITS) - 1),
        words: head >> PAD_BITS & 3,
        tail: tail_rows(rows - 1 - WARM, warm.len()),
    };
    match (order, low) {
        (Order::Values { .. }, _) => start.rest::<true, true>(indices, rows, bytes),
        (_, 0) => start.rest::<false, false>(indices, rows, bytes),
        _ => start.rest::<true, false>(indices, rows, bytes),
    }
}

/// What is stored before the symbols.
struct Head {
    order: Order,
    low: u32,
    pads: u64,
    /// Number of words modulo 4.
    words: u64,
    tail: usize,
}

impl Head {
    /// All indices; `indices` are those of the arithmetic code.
    fn rest<const LOW_BITS: bool, const OF_VALUES: bool>(
        &self,
        mut indices: Vec<i64>,
        rows: usize,
        mut bytes: Bytes<'_>,
    ) -> Result<Vec<i64>, Damaged> {
        let cut_off = || Damaged::new("block", "other words", "those that a writer of as many rows wrote");
        let learned = self.order.differences(&indices);
        let mut states = [0; LANES];
        for state in &mut states {
            *state = u32::from_le_bytes(bytes.array()?);
        }
        let (words, odd) = bytes.0.as_chunks();
        if !odd.is_empty() || words.len() as u64 % 4 != self.words {
            return Err(cut_off());
        }
        // Memory for all rows at once where so few bytes may hold them: a damaged number of rows takes no more than its bytes.
        indices.reserve((rows - indices.len()).min(ROWS_OF_A_WORD * words.len()));
        let mut words = Words::new(words);
        let mut tables = Tables::learned::<OF_VALUES>(&learned, self.low);
        let mut found = [0; LANES * STRETCH];
        let rest = rows - indices.len();
        for length in stretches(rest - self.tail) {
            let found = &mut found[..LANES * length];
            vectorised_narrow(
                #[inline(always)]
                || self.stretch::<LOW_BITS, OF_VALUES>(&mut tables, &mut words, &mut states, found),
            );
            // Checked here, so that time and memory are in proportion to the bytes.
            if words.is_broken() || states.iter().any(|state| *state < LOW) {
                return Err(cut_off());
            }
            self.order.push_indices(&mut indices, found)?;
        }
        let (first, others) = (states[0], &states[1..]);
        if others.iter().any(|state| *state >= 2 * LOW) {
            return Err(cut_off());
        }
        let late = words.behind(others.iter().map(|state| *state as u16));
        let (mut words, mut state) = (Words::new(&late), first);
        let pads = (0..self.pads).fold(0, |all, _| all | words.raw(&mut state, 16));
        let mut context = Context::<OF_VALUES>::START;
        let found: Vec<i64> = (indices.len()..rows)
            .map(|_| tables.read::<LOW_BITS, OF_VALUES>(&mut context, &mut state, &mut words, self.low))
            .collect();
        self.order.push_indices(&mut indices, &found)?;
        if pads != 0 || words.is_broken() || !words.is_finished() || state != 1 {
            return Err(cut_off());
        }
        Ok(indices)
    }

    /// The differences of four stretches, one behind the other.
    #[inline(always)]
    fn stretch<const LOW_BITS: bool, const OF_VALUES: bool>(
        &self,
        tables: &mut Tables,
        words: &mut Words<'_>,
        states: &mut [u32; LANES],
        found: &mut [i64],
    ) {
        // Local variables that nothing else can reach stay in registers.
        let ([mut x0, mut x1, mut x2, mut x3], mut own) = (*states, *words);
        let [mut c0, mut c1, mut c2, mut c3] = [Context::<OF_VALUES>::START; LANES];
        let length = found.len() / LANES;
        let (a, b) = found.split_at_mut(2 * length);
        let ((a, b), (c, d)) = (a.split_at_mut(length), b.split_at_mut(length));
        let first = a.chunks_mut(PERIOD).zip(b.chunks_mut(PERIOD));
        let second = c.chunks_mut(PERIOD).zip(d.chunks_mut(PERIOD));
        for ((a, b), (c, d)) in first.zip(second) {
            for ((a, b), (c, d)) in a.iter_mut().zip(b).zip(c.iter_mut().zip(d)) {
                *a = tables.read::<LOW_BITS, OF_VALUES>(&mut c0, &mut x0, &mut own, self.low);
                *b = tables.read::<LOW_BITS, OF_VALUES>(&mut c1, &mut x1, &mut own, self.low);
                *c = tables.read::<LOW_BITS, OF_VALUES>(&mut c2, &mut x2, &mut own, self.low);
                *d = tables.read::<LOW_BITS, OF_VALUES>(&mut c3, &mut x3, &mut own, self.low);
            }
            tables.renew();
        }
        (*states, *words) = ([x0, x1, x2, x3], own);
    }
}
