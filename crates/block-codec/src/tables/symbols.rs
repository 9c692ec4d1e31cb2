//! Symbols of differences, their contexts, and the tables that follow from how often each was seen.
//!
//! A difference is turned so that the last one that was not in the cell of zero was positive, and divided by `2^k`, rounded down: its cell. The `k` low bits are raw.
//!
//! ```text
//! symbol 0          a symbol that has no slot: 6 raw bits tell which; if these are 0, 50 raw bits hold the cell in zigzag form
//!        1 to 31    cells -15 to 15
//!        32 to 63   cells of size 2^e to 2^(e + 1) - 1, e = 4 to 19: 32 + 2 (e - 4), one more if positive; e raw bits are the rest of the size
//! ```
//!
//! Contexts: while the cell is zero, for how many rows (1, 2, 3 to 4, 5 to 8, 9 to 16, more; 1 also at the beginning); otherwise its size (1, 2, 3, more) and whether the
//! cell before was of the other sign, zero, of the same.

use super::words::{Part, SLOTS, Step, Words, raw_steps};
use crate::bytes::{unzigzag, zigzag};
use crate::rows::LARGEST;

const SYMBOLS: usize = 64;
const SYMBOL_BITS: u32 = 6;
/// Symbol of what has no slot.
const ESCAPE: usize = 0;
/// Symbol of the cell zero.
const ZERO: usize = 16;
/// First symbol of several cells, and the logarithm of their smallest size.
const RANGES: usize = 32;
const RANGE_BITS: u32 = 4;
/// Bits of a cell that has no symbol.
const WHOLE_BITS: u32 = 50;

/// States of a context: how long the cell is zero, then sizes with the sign before.
const RUNS: usize = 17;
const SIZES: usize = 4;
const STATES: usize = 32;
const CONTEXTS: usize = 6 + 3 * SIZES;
const _: () = assert!(RUNS + 3 * SIZES <= STATES && CONTEXTS <= STATES);

/// The context of a state.
const fn context_of(state: usize) -> usize {
    match state {
        0 => 0,
        1 => 1,
        2..=3 => 2,
        4..=7 => 3,
        8..=15 => 4,
        _ => state + 5 - (RUNS - 1),
    }
}

/// The state behind a symbol, times 256, and its context: at `SYMBOLS state + symbol`.
const NEXT: [u16; STATES * SYMBOLS] = {
    let mut next = [0; STATES * SYMBOLS];
    let mut at = 0;
    while at < next.len() {
        let (state, symbol) = (at / SYMBOLS, at % SYMBOLS);
        let is_up = if symbol < RANGES {
            symbol > ZERO || symbol == ESCAPE
        } else {
            symbol % 2 == 1
        };
        let size = if symbol == ESCAPE || symbol >= RANGES {
            SIZES
        } else {
            symbol.abs_diff(ZERO)
        };
        let size = if size > SIZES { SIZES } else { size };
        let to = if size == 0 {
            if state + 1 < RUNS {
                state + 1
            } else if state < RUNS {
                RUNS - 1
            } else {
                0
            }
        } else {
            let before = if state < RUNS {
                1
            } else if is_up {
                2
            } else {
                0
            };
            RUNS + 3 * (size - 1) + before
        };
        next[at] = (to << 8 | context_of(to)) as u16;
        at += 1;
    }
    next
};

/// What the next symbol of a lane depends on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context {
    /// State and context, as in [`NEXT`].
    state: u16,
    /// -1 if differences are turned, otherwise 0.
    turn: i64,
}

impl Context {
    pub(super) const START: Self = Self { state: 0, turn: 0 };

    #[inline(always)]
    fn index(self) -> usize {
        usize::from(self.state) % STATES
    }

    #[inline(always)]
    fn turned(self, difference: i64) -> i64 {
        (difference ^ self.turn) - self.turn
    }

    #[inline(always)]
    fn follow(&mut self, symbol: usize, is_negative: bool) {
        self.state = NEXT[(usize::from(self.state >> 8) * SYMBOLS + symbol) % NEXT.len()];
        self.turn ^= -i64::from(is_negative);
    }
}

/// The symbol of a cell, and its number of raw bits.
#[inline(always)]
fn symbol(cell: i64) -> (usize, u32) {
    let size = cell.unsigned_abs();
    if size < ZERO as u64 {
        return ((cell + ZERO as i64) as usize, 0);
    }
    let bits = size.ilog2();
    let symbol = RANGES + 2 * (bits - RANGE_BITS) as usize + usize::from(cell > 0);
    if symbol < SYMBOLS { (symbol, bits) } else { (ESCAPE, 0) }
}

/// Weight of the frequencies of all contexts in each, in symbols.
const COMMON: f32 = 24.0;
/// Weight of the symbol 0 beside them, in symbols of `2^-8`.
const ESCAPED: i32 = 128;
/// A table is made anew if so many symbols were added since, and one in `GROWTH`.
const FEW: u16 = 8;
const GROWTH: u16 = 5;
/// Number of symbols from which on counts are halved when a table is made.
const MOST: u16 = 1024;

/// Tables of all contexts.
#[derive(Debug)]
pub(super) struct Tables {
    counts: [[u16; SYMBOLS]; STATES],
    /// Sums of the counts when the tables were made, and how many symbols were added since.
    sums: [u16; STATES],
    added: [u16; STATES],
    parts: [[Part; SYMBOLS]; STATES],
    /// The symbol of each slot: only for reading.
    slots: [[u8; SLOTS + AT_ONCE]; STATES],
}

impl Tables {
    /// Tables after these differences. Those of writers have no slots.
    #[inline(always)]
    pub(super) fn learned<const READS: bool>(differences: &[i64], low: u32) -> Box<Self> {
        let mut tables = Box::new(Self {
            counts: [[0; SYMBOLS]; STATES],
            sums: [0; STATES],
            added: [0; STATES],
            parts: [[Part::default(); SYMBOLS]; STATES],
            slots: [[0; SLOTS + AT_ONCE]; STATES],
        });
        let mut context = Context::START;
        for difference in differences {
            let cell = context.turned(*difference) >> low;
            let (symbol, _) = symbol(cell);
            tables.counts[context.index()][symbol] += 1;
            context.follow(symbol, cell < 0);
        }
        tables.renew_if::<READS>(|_, _| true);
        tables
    }

    /// Writes a difference as one step or several.
    #[inline(always)]
    pub(super) fn write(&mut self, context: &mut Context, difference: i64, low: u32, mut push: impl FnMut(Step)) {
        let turned = context.turned(difference);
        let cell = turned >> low;
        let (symbol, bits) = symbol(cell);
        let at = context.index();
        let part = self.parts[at][symbol % SYMBOLS];
        if symbol == ESCAPE || part.width() == 0 {
            push(Step::Symbol(self.parts[at][ESCAPE]));
            raw_steps(symbol as u64, SYMBOL_BITS, &mut push);
            if symbol == ESCAPE {
                raw_steps(zigzag(cell), WHOLE_BITS, &mut push);
            }
        } else {
            push(Step::Symbol(part));
        }
        raw_steps(cell.unsigned_abs(), bits, &mut push);
        raw_steps(turned as u64, low, &mut push);
        self.counts[at][symbol % SYMBOLS] += 1;
        self.added[at] += 1;
        context.follow(symbol, cell < 0);
    }

    /// The difference that [`write`](Self::write) wrote.
    #[inline(always)]
    pub(super) fn read<const LOW_BITS: bool>(
        &mut self,
        context: &mut Context,
        state: &mut u32,
        words: &mut Words<'_>,
        low: u32,
    ) -> i64 {
        let at = context.index();
        let mut symbol = usize::from(self.slots[at][*state as usize % SLOTS]) % SYMBOLS;
        words.advance(state, self.parts[at][symbol]);
        let mut cell = symbol as i64 - ZERO as i64;
        if !(1..RANGES).contains(&symbol) {
            // A copy, so that the state itself stays in a register.
            let mut x = *state;
            (symbol, cell) = read_rare(symbol, &mut x, words, low);
            *state = x;
        }
        self.counts[at][symbol % SYMBOLS] += 1;
        self.added[at] += 1;
        let turned = if LOW_BITS {
            cell << low | words.long_raw(state, low) as i64
        } else {
            cell
        };
        let difference = context.turned(turned);
        context.follow(symbol, cell < 0);
        difference
    }

    /// Makes those tables anew whose counts have grown enough.
    #[inline(always)]
    pub(super) fn renew<const READS: bool>(&mut self) {
        self.renew_if::<READS>(|sum, added| (added >= FEW) & (GROWTH * added >= sum + added));
    }

    #[inline(always)]
    fn renew_if<const READS: bool>(&mut self, is_due: impl Fn(u16, u16) -> bool) {
        let mut due = [false; CONTEXTS];
        for ((due, sum), added) in due.iter_mut().zip(self.sums).zip(self.added) {
            *due = is_due(sum, added);
        }
        if !due.contains(&true) {
            return;
        }
        let mut all = [0_u16; SYMBOLS];
        for counts in &self.counts[..CONTEXTS] {
            all.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        let common = common(&all);
        // Most signals have no range of cells.
        let has_ranges = all[RANGES..].iter().any(|count| *count > 0);
        for (at, _) in due.iter().enumerate().filter(|(_, due)| **due) {
            if has_ranges {
                self.renew_one::<READS, SYMBOLS>(at, &common);
            } else {
                self.renew_one::<READS, RANGES>(at, &common);
            }
        }
    }

    /// Makes one table anew. `N`: all symbols from there on were never seen.
    #[inline(always)]
    fn renew_one<const READS: bool, const N: usize>(&mut self, at: usize, common: &[i32; SYMBOLS]) {
        let widths = widths::<N>(&self.counts[at], common);
        let (parts, mut start) = (&mut self.parts[at], 0);
        for (part, width) in parts.iter_mut().zip(widths) {
            *part = Part::new(start as u32, width as u32);
            start += width;
        }
        parts[N..].fill(Part::default());
        if READS {
            fill(&mut self.slots[at], &widths);
        }
        let counts = &mut self.counts[at];
        if counts.iter().sum::<u16>() > MOST {
            counts.iter_mut().for_each(|count| *count /= 2);
        }
        (self.sums[at], self.added[at]) = (counts.iter().sum(), 0);
    }
}

/// The frequencies of all contexts together in symbols of `2^-8`, of which there are [`COMMON`]. A tenth of those of cells is moved to each
/// neighbour.
#[inline(always)]
fn common(all: &[u16; SYMBOLS]) -> [i32; SYMBOLS] {
    let mut common = all.map(|count| 10 * i32::from(count));
    for at in 1..RANGES {
        let left = if at > 1 { all[at - 1] } else { 0 };
        let right = if at + 1 < RANGES { all[at + 1] } else { 0 };
        common[at] += i32::from(left) + i32::from(right) - 2 * i32::from(all[at]);
    }
    let share = 256.0 * COMMON / common.iter().sum::<i32>().max(1) as f32;
    let mut common = common.map(|count| (count as f32 * share) as i32);
    common[ESCAPE] += ESCAPED;
    common
}

/// Slots of each symbol: in proportion to the counts and what is common, rounded; at least one for a symbol that was seen in this
/// context, takes a quarter of a slot, or is 0.
#[inline(always)]
fn widths<const N: usize>(counts: &[u16; SYMBOLS], common: &[i32; SYMBOLS]) -> [i32; N] {
    let mut widths = [0; N];
    for ((width, count), common) in widths.iter_mut().zip(counts).zip(common) {
        *width = (i32::from(*count) << 8) + common;
    }
    let share = (4 * SLOTS) as f32 / widths.iter().sum::<i32>() as f32;
    for (width, count) in widths.iter_mut().zip(counts) {
        let quarters = (*width as f32 * share) as i32;
        let least = i32::from(quarters > 0) | i32::from(*count > 0);
        *width = ((quarters + 2) >> 2).max(least);
    }
    widths[ESCAPE] = widths[ESCAPE].max(1);
    // The largest gives or takes what is left. While there are too many it has `SLOTS / SYMBOLS` at least, so each round takes some.
    let mut over = widths.iter().sum::<i32>() - SLOTS as i32;
    while over != 0 {
        let most = widths.iter().copied().fold(0, i32::max);
        let taken = over.min(most / 2);
        if let Some(width) = widths.iter_mut().find(|width| **width == most) {
            *width -= taken;
        }
        over -= taken;
    }
    widths
}

/// Slots that are written at once, also beyond those of a symbol: these are written again for later ones.
const AT_ONCE: usize = 32;

#[inline(always)]
fn fill<const N: usize>(slots: &mut [u8; SLOTS + AT_ONCE], widths: &[i32; N]) {
    let mut start = 0;
    for (symbol, width) in (0..).zip(widths) {
        let end = start + *width as usize;
        loop {
            slots[start..start + AT_ONCE].copy_from_slice(&[symbol; AT_ONCE]);
            start += AT_ONCE;
            if start >= end {
                break;
            }
        }
        start = end;
    }
}

/// Symbol and cell where the symbol read is not that of one cell.
#[cold]
#[inline(never)]
fn read_rare(mut symbol: usize, state: &mut u32, words: &mut Words<'_>, low: u32) -> (usize, i64) {
    if symbol == ESCAPE {
        symbol = words.raw(state, SYMBOL_BITS) as usize;
        if symbol == ESCAPE {
            return (ESCAPE, checked(unzigzag(words.long_raw(state, WHOLE_BITS)), words, low));
        }
        if symbol < RANGES {
            return (symbol, symbol as i64 - ZERO as i64);
        }
    }
    let bits = RANGE_BITS + (symbol - RANGES) as u32 / 2;
    let size = (1 << bits | words.long_raw(state, bits)) as i64;
    (symbol, checked(if symbol % 2 == 1 { size } else { -size }, words, low))
}

/// A cell as it was read; zero if no writer writes so large a difference of differences, whose sums could overflow.
fn checked(cell: i64, words: &mut Words<'_>, low: u32) -> i64 {
    if cell.unsigned_abs() <= (8 * LARGEST as u64) >> low {
        return cell;
    }
    words.refuse();
    0
}
