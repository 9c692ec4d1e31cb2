//! Tables of symbols, which follow from how often each was seen.

use super::alphabet::{
    CONTEXTS, Context, ESCAPE, RANGE_BITS, RANGES, STATES, SYMBOL_BITS, SYMBOLS, WHOLE_BITS, ZERO, symbol,
};
use super::words::{Part, SLOTS, Words};
use crate::bytes::unzigzag;
use crate::rows::LARGEST;

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
    /// The symbol of each slot.
    slots: [[u8; SLOTS + AT_ONCE]; STATES],
}

impl Tables {
    /// Tables after these differences.
    #[inline(always)]
    pub(super) fn learned<const OF_VALUES: bool>(differences: &[i64], low: u32) -> Box<Self> {
        let mut tables = Box::new(Self {
            counts: [[0; SYMBOLS]; STATES],
            sums: [0; STATES],
            added: [0; STATES],
            parts: [[Part::default(); SYMBOLS]; STATES],
            slots: [[0; SLOTS + AT_ONCE]; STATES],
        });
        let mut context = Context::<OF_VALUES>::START;
        for difference in differences {
            let cell = context.turned(*difference) >> low;
            let (symbol, _) = symbol(cell);
            tables.counts[context.index()][symbol] += 1;
            context.follow(symbol, cell < 0);
        }
        tables.renew_if(|_, _| true);
        tables
    }

    /// The next difference.
    #[inline(always)]
    pub(super) fn read<const LOW_BITS: bool, const OF_VALUES: bool>(
        &mut self,
        context: &mut Context<OF_VALUES>,
        state: &mut u32,
        words: &mut Words<'_>,
        low: u32,
    ) -> i64 {
        let at = context.index();
        let mut symbol = usize::from(self.slots[at][*state as usize % SLOTS]) % SYMBOLS;
        words.advance(state, self.parts[at][symbol]);
        let mut cell = symbol as i64 - ZERO as i64;
        if !(1..RANGES).contains(&symbol) {
            // Copies, so that the state and the words themselves stay in registers.
            let (mut x, mut rest) = (*state, *words);
            (symbol, cell) = read_rare(symbol, &mut x, &mut rest, low);
            (*state, *words) = (x, rest);
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
    pub(super) fn renew(&mut self) {
        self.renew_if(|sum, added| (added >= FEW) & (GROWTH * added >= sum + added));
    }

    #[inline(always)]
    fn renew_if(&mut self, is_due: impl Fn(u16, u16) -> bool) {
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
                self.renew_one::<SYMBOLS>(at, &common);
            } else {
                self.renew_one::<RANGES>(at, &common);
            }
        }
    }

    /// Makes one table anew. `N`: all symbols from there on were never seen.
    #[inline(always)]
    fn renew_one<const N: usize>(&mut self, at: usize, common: &[i32; SYMBOLS]) {
        let widths = widths::<N>(&self.counts[at], common);
        let (parts, mut start) = (&mut self.parts[at], 0);
        for (part, width) in parts.iter_mut().zip(widths) {
            *part = Part::new(start as u32, width as u32);
            start += width;
        }
        parts[N..].fill(Part::default());
        fill(&mut self.slots[at], &widths);
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
        // Size and place of the first of the largest ones in one number.
        let places = (0..SYMBOLS as i32).rev();
        let largest = widths
            .iter()
            .zip(places)
            .fold(0, |most, (width, place)| most.max(*width << SYMBOL_BITS | place));
        let place = SYMBOLS - 1 - largest as usize % SYMBOLS;
        let taken = over.min((largest >> SYMBOL_BITS) / 2);
        widths[place % N] -= taken;
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
