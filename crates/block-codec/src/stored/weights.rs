//! Tables of symbols: which contexts share one, and a weight for each symbol.
//!
//! ```text
//! 4 bits, 4 bits          largest sizes of negative and of positive cells that have a weight
//! 15 decisions            for each context but the first one, whether it has the table of the context before
//! for each table          weights of the symbols 0, 16, and then 17, 15, 18, 14, .. as far as they have one
//! weight                  its length in bits, at most 7, in unary code: decisions whose context is the length of the expected weight;
//!                         of lengths from 2 on the second highest bit, a decision whose context is the length; all other bits raw
//! ```
//!
//! The expected weight is that of the neighbouring cell nearer to zero, or if there is a table before, the mean of that and of the weight there,
//! rounded up; of the symbols 0 and 16 it is that in the table before, or in the first table 0 and 8.
//!
//! A symbol's slots are in proportion to the square of its weight. Weights are square roots of counts, because counts have standard deviations in
//! proportion to their square roots: then all weights have the same precision.

use super::alphabet::{CONTEXTS, ESCAPE, SYMBOLS, ZERO, next_context};
use super::words::fill_slots;
use crate::arithmetic::Coder;
use crate::counts::Count;
use crate::error::{Damaged, ensure};
use crate::groups::{joined, sums};
use fewbits_node::elementary::log2;

/// A table has `2^SLOT_BITS` slots.
pub(super) const SLOT_BITS: u32 = 9;
pub(super) const SLOTS: usize = 1 << SLOT_BITS;
/// Rows of a symbol of weight one: the weight of fewer bits against longer weights.
const ROWS_OF_ONE: f32 = 3.0;
const WEIGHT_BITS: usize = 7;
const LARGEST_WEIGHT: u32 = (1 << WEIGHT_BITS) - 1;
/// Expected weight of zero in the first table.
const FIRST_ZERO: u8 = 8;
/// Estimated bits of a weight that is not zero, and of any weight.
const BITS_OF_USED: f32 = 2.2;
const BITS_OF_ANY: f32 = 0.5;
/// Bits of the largest sizes.
const SIZES_FIELD: u32 = 4;

pub(super) type Counts = [[u32; SYMBOLS]; CONTEXTS];
pub(super) type Widths = [u32; SYMBOLS];

/// The tables of a block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tables {
    /// Largest sizes of negative and of positive cells that have a weight.
    sizes: [usize; 2],
    /// Table of each context.
    table_of: [usize; CONTEXTS],
    weights: Vec<[u8; SYMBOLS]>,
}

impl Tables {
    /// The tables for these counts: starting with one for each context, the two neighbours that save most bits together are joined as
    /// long as any do.
    #[inline(always)]
    pub(super) fn of(counts: &Counts) -> Self {
        let is_used = |symbol: &usize| counts.iter().any(|counts| counts[*symbol] > 0);
        let lowest = (1..ZERO).find(is_used).unwrap_or(ZERO);
        let highest = (ZERO + 1..SYMBOLS).rev().find(is_used).unwrap_or(ZERO);
        let bits_of_table = BITS_OF_ANY * (highest - lowest) as f32;
        let bits = |_, counts: &[u32; SYMBOLS]| {
            let (sum, logs) = sums(counts);
            let used = counts
                .iter()
                .fold(0.0, |used, count| used + f32::from(u8::from(*count > 0)));
            if sum > 0.0 {
                sum * log2(sum) - logs + BITS_OF_USED * used + bits_of_table
            } else {
                1.0
            }
        };
        let groups = joined(counts.iter().map(|counts| (1, *counts)), bits, 0.0);
        let largest = groups.iter().flat_map(|group| group.counts).max().unwrap_or(0) as f32;
        let share = 1.0 / ROWS_OF_ONE.max(largest / (LARGEST_WEIGHT * LARGEST_WEIGHT) as f32);
        let root = |count: u32| ((count as f32 * share).sqrt() + 0.5) as u32;
        let weight = |count: u32| root(count).clamp(count.min(1), LARGEST_WEIGHT) as u8;
        let (mut table_of, mut weights, mut begun) = ([0; CONTEXTS], Vec::new(), 0);
        for group in groups {
            table_of[begun..begun + group.size].fill(weights.len());
            weights.push(group.counts.map(weight));
            begun += group.size;
        }
        Self {
            sizes: [ZERO - lowest, highest - ZERO],
            table_of,
            weights,
        }
    }

    /// Codes the tables: `wanted` at the writer, `None` at the reader.
    pub(super) fn code<C: Coder>(coder: &mut C, wanted: Option<&Self>) -> Result<Self, Damaged> {
        let told = wanted.map_or([0; 2], |tables| tables.sizes);
        let sizes = told.map(|size| coder.raw(size as u64, SIZES_FIELD) as usize);
        let (mut join, mut table_of) = (Count::NEW, [0; CONTEXTS]);
        for context in 1..CONTEXTS {
            let own = wanted.is_some_and(|tables| tables.table_of[context] == tables.table_of[context - 1]);
            let is_joined = join.decide(coder, own);
            table_of[context] = table_of[context - 1] + usize::from(!is_joined);
        }
        let mut weight_coder = WeightCoder::NEW;
        let mut weights: Vec<[u8; SYMBOLS]> = Vec::with_capacity(CONTEXTS);
        for table in 0..=table_of[CONTEXTS - 1] {
            let own = wanted.map(|tables| &tables.weights[table]);
            weights.push(weight_coder.code(coder, own, weights.last(), sizes));
        }
        ensure!(!coder.overran(), Damaged::new("tables", "cut off", "a weight for each symbol"));
        Ok(Self {
            sizes,
            table_of,
            weights,
        })
    }

    /// The slots of the symbols in each context.
    pub(super) fn widths(&self) -> impl Iterator<Item = Widths> {
        let widths: Vec<Widths> = self.weights.iter().map(widths).collect();
        self.table_of.into_iter().map(move |table| widths[table])
    }

    /// The entries of all slots.
    pub(super) fn entries(&self, is_of_values: bool) -> Entries {
        let mut all = Box::new([0; CONTEXTS * SLOTS + AT_ONCE]);
        let pattern: [u32; AT_ONCE] = std::array::from_fn(|slot| (slot as u32) << OFFSET_SHIFT);
        for (context, widths) in self.widths().enumerate() {
            let mut start = context << SLOT_BITS;
            for (symbol, width) in widths.iter().enumerate().filter(|(_, width)| **width > 0) {
                let cell = (symbol as u32).wrapping_sub(ZERO as u32) << CELL_SHIFT;
                let next = (next_context(SYMBOLS * context + symbol, is_of_values) as u32) << NEXT_SHIFT;
                let (mut entry, mut from, end) = (cell | next | width, start, start + *width as usize);
                while from < end {
                    let slots = pattern.map(|offset| entry + offset);
                    all[from..from + AT_ONCE].copy_from_slice(&slots);
                    (entry, from) = (entry + ((AT_ONCE as u32) << OFFSET_SHIFT), from + AT_ONCE);
                }
                start = end;
            }
        }
        Entries(all)
    }
}

/// The decisions of weights.
struct WeightCoder {
    lengths: [[Count; WEIGHT_BITS]; WEIGHT_BITS + 1],
    seconds: [Count; WEIGHT_BITS + 1],
}

impl WeightCoder {
    const NEW: Self = Self {
        lengths: [[Count::NEW; WEIGHT_BITS]; WEIGHT_BITS + 1],
        seconds: [Count::NEW; WEIGHT_BITS + 1],
    };

    /// Codes the weights of one table.
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<&[u8; SYMBOLS]>,
        before: Option<&[u8; SYMBOLS]>,
        [negative, positive]: [usize; 2],
    ) -> [u8; SYMBOLS] {
        let mut weights = [0; SYMBOLS];
        let mut code = |symbol: usize, expected| {
            weights[symbol] = self.weight(coder, wanted.map_or(0, |wanted| wanted[symbol]), expected);
            weights[symbol]
        };
        code(ESCAPE, before.map_or(0, |before| before[ESCAPE]));
        let zero = code(ZERO, before.map_or(FIRST_ZERO, |before| before[ZERO]));
        let expected = |near: u8, symbol: usize| before.map_or(near, |before| (near + before[symbol]).div_ceil(2));
        let (mut above, mut below) = (zero, zero);
        for size in 1..=negative.max(positive) {
            if size <= positive {
                above = code(ZERO + size, expected(above, ZERO + size));
            }
            if size <= negative {
                below = code(ZERO - size, expected(below, ZERO - size));
            }
        }
        weights
    }

    #[inline(always)]
    fn weight<C: Coder>(&mut self, coder: &mut C, wanted: u8, expected: u8) -> u8 {
        let bits = |weight: u8| (u8::BITS - weight.leading_zeros()) as usize;
        let (own, mut length) = (bits(wanted), 0);
        let lengths = &mut self.lengths[bits(expected)];
        while length < WEIGHT_BITS && lengths[length].decide(coder, length < own) {
            length += 1;
        }
        if length < 2 {
            return length as u8;
        }
        let low = length as u32 - 2;
        let second = self.seconds[length].decide(coder, wanted >> low & 1 == 1);
        (2 | u8::from(second)) << low | coder.raw(u64::from(wanted) & ((1 << low) - 1), low) as u8
    }
}

/// Slots of each symbol: in proportion to the squares of the weights, rounded; at least one if the weight is not zero, and for symbol 0: a
/// symbol that fills a table would let any number of rows be read from no bytes.
fn widths(weights: &[u8; SYMBOLS]) -> Widths {
    let squares = weights.map(|weight| u32::from(weight) * u32::from(weight));
    let share = (2 * SLOTS) as f32 / squares.iter().sum::<u32>().max(1) as f32;
    let mut widths = squares.map(|square| {
        let halves = (square as f32 * share) as u32;
        ((halves + 1) >> 1).max(square.min(1))
    });
    widths[ESCAPE] = widths[ESCAPE].max(1);
    fill_slots(&mut widths, SLOTS);
    widths
}

/// Entries that are written at once, also beyond those of a symbol: these are written again for later ones.
const AT_ONCE: usize = 8;

const OFFSET_SHIFT: u32 = 12;
const NEXT_SHIFT: u32 = 23;
const CELL_SHIFT: u32 = 27;

/// A slot: the width of its symbol (10 bits), from bit 12 on its place in the symbol, from 23 on the next context, from 27 on the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry(u32);

impl Entry {
    /// The state behind the symbol, before it takes a word.
    #[inline(always)]
    pub(super) fn advanced(self, state: u32) -> u32 {
        (self.0 % (2 * SLOTS as u32)) * (state >> SLOT_BITS) + (self.0 >> OFFSET_SHIFT) % SLOTS as u32
    }

    #[inline(always)]
    pub(super) fn cell(self) -> i64 {
        i64::from(self.0 as i32 >> CELL_SHIFT)
    }

    /// First slot of the table of the next context.
    #[inline(always)]
    pub(super) fn next_table(self) -> usize {
        ((self.0 >> NEXT_SHIFT) as usize % CONTEXTS) << SLOT_BITS
    }
}

/// The entries of all slots, context by context, and some behind them that are not used.
pub(super) struct Entries(Box<[u32; CONTEXTS * SLOTS + AT_ONCE]>);

impl Entries {
    /// The slot of a state in the table that begins there.
    #[inline(always)]
    pub(super) fn at(&self, table: usize, state: u32) -> Entry {
        Entry(self.0[(table | (state as usize % SLOTS)) % (CONTEXTS * SLOTS)])
    }
}
