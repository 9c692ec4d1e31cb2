//! The writer's lanes: symbols of all rows and their counts, then from the last row to the first the words.

use super::alphabet::{CODES, ESCAPE, SIZE_FIELD, SMALLEST, SYMBOLS, first_context, next_context, symbol};
use super::weights::{Counts, SLOT_BITS, SLOTS, Tables};
use super::words::{LANES, LOW, WORD_BITS, stretches};
use crate::vectors::narrow;
use std::hint::select_unpredictable;

/// Codes of rows (`SYMBOLS context + symbol`) and how often each lane has each.
pub(super) struct Symbols {
    /// The rows of the stretches, four side by side.
    codes: Vec<[u16; LANES]>,
    /// The rows of the tail.
    tail: Vec<u16>,
    counts: [[u32; CODES]; LANES],
}

/// The context of the next row, and whether its difference is turned (-1) or not (0).
#[derive(Clone, Copy)]
pub(super) struct Place<const OF_VALUES: bool> {
    context: usize,
    turn: i64,
}

impl<const OF_VALUES: bool> Place<OF_VALUES> {
    pub(super) const START: Self = Self {
        context: first_context(OF_VALUES),
        turn: 0,
    };

    /// The code of a difference, which is turned.
    #[inline(always)]
    pub(super) fn code(&mut self, difference: &mut i64, low: u32) -> usize {
        *difference = (*difference ^ self.turn) - self.turn;
        let cell = *difference >> low;
        let code = (SYMBOLS * self.context + symbol(cell)) % CODES;
        self.context = next_context(code, OF_VALUES);
        if !OF_VALUES {
            self.turn ^= cell >> 63;
        }
        code
    }
}

impl Symbols {
    /// The symbols of all differences, which are turned. So many of them belong to stretches.
    #[inline(always)]
    pub(super) fn new<const OF_VALUES: bool>(differences: &mut [i64], stretched: usize, low: u32) -> Box<Self> {
        let (mut stretched, tail) = differences.split_at_mut(stretched);
        let mut own = Box::new(Self {
            codes: Vec::with_capacity(stretched.len() / LANES),
            tail: Vec::with_capacity(tail.len()),
            counts: [[0; CODES]; LANES],
        });
        let Self { codes, counts, .. } = &mut *own;
        for length in stretches(stretched.len()) {
            let (rows, others) = std::mem::take(&mut stretched).split_at_mut(LANES * length);
            stretched = others;
            let (first, second) = rows.split_at_mut(2 * length);
            let ((first, second), (third, fourth)) = (first.split_at_mut(length), second.split_at_mut(length));
            let [mut a, mut b, mut c, mut d] = [Place::<OF_VALUES>::START; LANES];
            for ((p, q), (r, s)) in first.iter_mut().zip(second).zip(third.iter_mut().zip(fourth)) {
                let found = [a.code(p, low), b.code(q, low), c.code(r, low), d.code(s, low)];
                counts
                    .iter_mut()
                    .zip(found)
                    .for_each(|(counts, code)| counts[code] += 1);
                codes.push(found.map(|code| code as u16));
            }
        }
        let mut place = Place::<OF_VALUES>::START;
        for difference in tail {
            let code = place.code(difference, low);
            own.counts[0][code] += 1;
            own.tail.push(code as u16);
        }
        own
    }

    /// How often each context has each symbol.
    pub(super) fn counts(&self) -> Counts {
        let all = |code: usize| self.counts.iter().map(|counts| counts[code]).sum();
        std::array::from_fn(|context| std::array::from_fn(|symbol| all(SYMBOLS * context + symbol)))
    }

    /// The words of all rows. `turned`: the differences as [`new`](Self::new) left them.
    pub(super) fn encoded(&self, tables: &Tables, turned: &[i64], low: u32) -> Words {
        let mut parts = [Part::default(); CODES];
        for (parts, widths) in parts.chunks_mut(SYMBOLS).zip(tables.widths()) {
            let mut start = 0;
            for (part, width) in parts.iter_mut().zip(widths) {
                *part = Part::new(start, width);
                start += width;
            }
        }
        let escapes = self
            .counts
            .iter()
            .flat_map(|counts| counts.iter().step_by(SYMBOLS))
            .sum::<u32>() as usize;
        narrow!({
            if low > 0 || escapes > 0 {
                self.coded::<true>(&parts, turned, low, escapes)
            } else {
                self.coded::<false>(&parts, turned, low, escapes)
            }
        })
    }

    /// `RAW`: whether any row has raw bits.
    #[inline(always)]
    fn coded<const RAW: bool>(&self, parts: &[Part; CODES], turned: &[i64], low: u32, escapes: usize) -> Words {
        // A symbol takes at most one word, and so do 16 raw bits.
        let words_of_row = 1 + low.div_ceil(WORD_BITS) as usize;
        let most = turned.len() * words_of_row + escapes * MOST_OF_ESCAPE + LANES * PADS;
        let mut words = Words {
            states: [1; LANES],
            words: vec![0; most],
            count: 0,
            pads: 0,
        };
        let (mut stretched, tail) = turned.split_at(LANES * self.codes.len());
        let mut state = 1;
        for (code, turned) in self.tail.iter().zip(tail).rev() {
            words.row::<RAW>(&mut state, *code, parts, *turned, low);
        }
        // The words that the states of the other lanes hold, and a whole state of the first.
        while words.count < LANES - 1 || state < LOW {
            words.raw(&mut state, 0, WORD_BITS);
            words.pads += 1;
        }
        words.count -= LANES - 1;
        let held = |place: usize| LOW | u32::from(words.words[words.count + place]);
        let [mut x0, mut x1, mut x2, mut x3] = [state, held(2), held(1), held(0)];
        let mut codes = self.codes.as_slice();
        for length in stretches(stretched.len()).collect::<Vec<_>>().into_iter().rev() {
            let (others, rows) = stretched.split_at(stretched.len() - LANES * length);
            stretched = others;
            let (before, own) = codes.split_at(codes.len() - length);
            codes = before;
            let (first, second) = rows.split_at(2 * length);
            let ((first, second), (third, fourth)) = (first.split_at(length), second.split_at(length));
            let turned = first.iter().zip(second).zip(third.iter().zip(fourth));
            for ([p, q, r, s], ((a, b), (c, d))) in own.iter().zip(turned).rev() {
                words.row::<RAW>(&mut x3, *s, parts, *d, low);
                words.row::<RAW>(&mut x2, *r, parts, *c, low);
                words.row::<RAW>(&mut x1, *q, parts, *b, low);
                words.row::<RAW>(&mut x0, *p, parts, *a, low);
            }
        }
        words.states = [x0, x1, x2, x3];
        words.words.truncate(words.count);
        words
    }
}

/// More than the number of pads of a lane.
const PADS: usize = 2;
/// Words of a cell that has no symbol at most.
const MOST_OF_ESCAPE: usize = 5;
/// More than the bits of a state less those of a word, and of a quotient by a width.
const QUOTIENT_SHIFT: u32 = u32::BITS + SLOT_BITS;

/// A symbol's slots in its table.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    /// `2^41 / width`, rounded up. States are below `2^23 width` where they are divided, so that quotients are exact.
    reciprocal: u64,
    width: u32,
    start: u32,
}

impl Part {
    fn new(start: u32, width: u32) -> Self {
        let reciprocal = (1_u64 << QUOTIENT_SHIFT).div_ceil(u64::from(width.max(1)));
        Self {
            reciprocal,
            width,
            start,
        }
    }

    #[inline(always)]
    fn quotient(&self, x: u32) -> u32 {
        ((u64::from(x) * self.reciprocal) >> QUOTIENT_SHIFT) as u32
    }
}

#[cfg(test)]
pub(super) fn quotient(x: u32, width: u32) -> u32 {
    Part::new(0, width).quotient(x)
}

/// What the lanes write.
pub(super) struct Words {
    /// The states of the lanes at the beginning.
    pub(super) states: [u32; LANES],
    /// The words with the last one first.
    pub(super) words: Vec<u16>,
    count: usize,
    pub(super) pads: u64,
}

impl Words {
    /// Writes a word if the state has reached the limit.
    #[inline(always)]
    fn shortened(&mut self, state: u32, limit: u64) -> u32 {
        let is_full = u64::from(state) >= limit;
        self.words[self.count] = state as u16;
        self.count += usize::from(is_full);
        select_unpredictable(is_full, state >> WORD_BITS, state)
    }

    #[inline(always)]
    fn symbol(&mut self, state: &mut u32, part: &Part) {
        let x = self.shortened(*state, u64::from(part.width) << (u32::BITS - SLOT_BITS));
        *state = x + part.quotient(x) * (SLOTS as u32 - part.width) + part.start;
    }

    /// At most 16 raw bits.
    #[inline(always)]
    fn raw(&mut self, state: &mut u32, value: u64, bits: u32) {
        let x = self.shortened(*state, 1 << (u32::BITS - bits));
        *state = x << bits | (value & ((1 << bits) - 1)) as u32;
    }

    /// Raw bits, of which the lowest 16 are read first.
    #[inline(always)]
    fn long_raw(&mut self, state: &mut u32, value: u64, bits: u32) {
        let mut done = bits;
        while done > 0 {
            let count = done - (done - 1) / WORD_BITS * WORD_BITS;
            done -= count;
            self.raw(state, value >> done, count);
        }
    }

    /// A row of this code.
    #[inline(always)]
    fn row<const RAW: bool>(&mut self, state: &mut u32, code: u16, parts: &[Part; CODES], turned: i64, low: u32) {
        let code = usize::from(code) % CODES;
        if RAW {
            self.long_raw(state, turned as u64, low);
            if code % SYMBOLS == ESCAPE {
                let cell = turned >> low;
                let bits = cell.unsigned_abs().ilog2();
                self.long_raw(state, cell.unsigned_abs(), bits);
                self.raw(state, u64::from(2 * (bits - SMALLEST)) | u64::from(cell < 0), SIZE_FIELD);
            }
        }
        self.symbol(state, &parts[code]);
    }
}
