//! Symbols of differences or of values, and the contexts in which they are coded.
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
//!
//! Values are not turned. Their contexts are the size of the last cell (0 to 4, 5 to 6, 7 to 9, 10 to 13, more; more also behind symbol 0) and its sign (minus
//! behind symbol 0); at the beginning 0.

pub(super) const SYMBOLS: usize = 64;
pub(super) const SYMBOL_BITS: u32 = 6;
/// Symbol of what has no slot.
pub(super) const ESCAPE: usize = 0;
/// Symbol of the cell zero.
pub(super) const ZERO: usize = 16;
/// First symbol of several cells, and the logarithm of their smallest size.
pub(super) const RANGES: usize = 32;
pub(super) const RANGE_BITS: u32 = 4;
/// Bits of a cell that has no symbol.
pub(super) const WHOLE_BITS: u32 = 50;

/// States of a context: how long the cell is zero, then sizes with the sign before.
const RUNS: usize = 17;
const SIZES: usize = 4;
pub(super) const STATES: usize = 32;
pub(super) const CONTEXTS: usize = 6 + 3 * SIZES;
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

/// Contexts of values.
const VALUES: usize = 17;
const _: () = assert!(VALUES <= CONTEXTS);

/// The context, which is also the state, behind a symbol of a value.
const fn value_state(symbol: usize) -> usize {
    let (size, is_up) = if symbol == ESCAPE || symbol >= RANGES {
        (SYMBOLS, symbol % 2 == 1)
    } else {
        (symbol.abs_diff(ZERO), symbol > ZERO)
    };
    let class = match size {
        0..=4 => size,
        5..=6 => 5,
        7..=9 => 6,
        10..=13 => 7,
        _ => 8,
    };
    VALUES / 2 + class - if is_up { 0 } else { 2 * class }
}

/// The same table for values.
static NEXT_OF_VALUES: [u16; STATES * SYMBOLS] = {
    let mut next = [0; STATES * SYMBOLS];
    let mut at = 0;
    while at < next.len() {
        let state = value_state(at % SYMBOLS);
        next[at] = (state << 8 | state) as u16;
        at += 1;
    }
    next
};

/// The state behind a symbol of a difference, times 256, and its context: at `SYMBOLS state + symbol`.
static NEXT: [u16; STATES * SYMBOLS] = {
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

/// What the next symbol of a lane depends on: symbols of values, or of differences.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context<const OF_VALUES: bool> {
    /// State and context, as in [`NEXT`].
    state: u16,
    /// -1 if differences are turned, otherwise 0.
    turn: i64,
}

impl<const OF_VALUES: bool> Context<OF_VALUES> {
    pub(super) const START: Self = Self {
        state: if OF_VALUES {
            (value_state(ZERO) << 8 | value_state(ZERO)) as u16
        } else {
            0
        },
        turn: 0,
    };

    #[inline(always)]
    pub(super) fn index(self) -> usize {
        usize::from(self.state) % STATES
    }

    #[inline(always)]
    pub(super) fn turned(self, difference: i64) -> i64 {
        (difference ^ self.turn) - self.turn
    }

    #[inline(always)]
    pub(super) fn follow(&mut self, symbol: usize, is_negative: bool) {
        let at = (usize::from(self.state >> 8) * SYMBOLS + symbol) % NEXT.len();
        if OF_VALUES {
            self.state = NEXT_OF_VALUES[at];
        } else {
            self.state = NEXT[at];
            self.turn ^= -i64::from(is_negative);
        }
    }
}

/// The symbol of a cell, and its number of raw bits.
#[inline(always)]
pub(super) fn symbol(cell: i64) -> (usize, u32) {
    let size = cell.unsigned_abs();
    if size < ZERO as u64 {
        return ((cell + ZERO as i64) as usize, 0);
    }
    let bits = size.ilog2();
    let symbol = RANGES + 2 * (bits - RANGE_BITS) as usize + usize::from(cell > 0);
    if symbol < SYMBOLS { (symbol, bits) } else { (ESCAPE, 0) }
}
