//! Symbols of differences or of values, and the contexts in which they are coded.
//!
//! A difference is turned so that the last one that was not in the cell of zero was positive, and divided by `2^k`, rounded down: its cell. The `k` low bits are raw.
//!
//! ```text
//! symbol 0          any other cell, of size 2^e to 2^(e + 1) - 1: 2 (e - 4), one more if negative (7 raw bits), then e raw bits
//!        1 to 31    cells -15 to 15
//! ```
//!
//! Contexts: how many cells are zero (6 or more, also at the beginning, 5, .. 1); then for sizes 1 and 2 of the last cell whether the cell before was
//! zero, of the other sign, of the same; for sizes 3 and more whether it was of the other sign. Behind symbol 0 the context is the last one.
//!
//! Values are not turned. Their contexts are the size of the last cell (0 to 4, 5 to 6, 7 to 9, more) in the order of the values, the last
//! one behind symbol 0; at the beginning 0.

pub(super) const SYMBOL_BITS: u32 = 5;
pub(super) const SYMBOLS: usize = 1 << SYMBOL_BITS;
pub(super) const CONTEXTS: usize = 16;
/// Symbol of what has no symbol of its own.
pub(super) const ESCAPE: usize = 0;
/// Symbol of the cell zero.
pub(super) const ZERO: usize = 16;
/// Raw bits of the size and the sign of a cell that has no symbol.
pub(super) const SIZE_FIELD: u32 = 7;
/// Smallest number of bits below the highest one of such a cell, and the largest.
pub(super) const SMALLEST: u32 = 4;
pub(super) const LARGEST_SIZE: u32 = 49;

/// Contexts of zero cells.
const RUNS: usize = 6;

/// Symbols in contexts, whose number is a power of two.
pub(super) const CODES: usize = CONTEXTS * SYMBOLS;

const fn behind_difference(context: usize, symbol: usize) -> usize {
    let is_run = context < RUNS;
    let is_turn = symbol < ZERO && !is_run;
    let sign = if is_run { 0 } else { 2 - is_turn as usize };
    match symbol.abs_diff(ZERO) {
        0 if is_run => context.saturating_sub(1),
        0 => RUNS - 1,
        size @ 1..=2 => RUNS + 3 * (size - 1) + sign,
        3 => 13 - is_turn as usize,
        ZERO => CONTEXTS - 1,
        _ => CONTEXTS - 1 - is_turn as usize,
    }
}

const fn behind_value(symbol: usize) -> usize {
    let size = symbol.abs_diff(ZERO);
    let class = if size < 10 { size_class(size) } else { 7 };
    match symbol {
        ESCAPE => CONTEXTS - 1,
        1..ZERO => 7 - class,
        _ => 7 + class,
    }
}

/// The class of a size of values: 0 to 4, 5 to 6, 7 to 9, 10 to 13, more.
pub(crate) const fn size_class(size: usize) -> usize {
    match size {
        0..=4 => size,
        5..=6 => 5,
        7..=9 => 6,
        10..=13 => 7,
        _ => 8,
    }
}

/// The contexts behind symbols of differences, and of values: at `SYMBOLS context + symbol`.
static NEXT: [[u8; CODES]; 2] = {
    let mut next = [[0; CODES]; 2];
    let mut at = 0;
    while at < CODES {
        let symbol = at % SYMBOLS;
        next[0][at] = behind_difference(at / SYMBOLS, symbol) as u8;
        next[1][at] = behind_value(symbol) as u8;
        at += 1;
    }
    next
};

/// The context behind a code, which is `SYMBOLS context + symbol`.
#[inline(always)]
pub(super) fn next_context(code: usize, is_of_values: bool) -> usize {
    usize::from(NEXT[usize::from(is_of_values)][code % CODES])
}

/// The context at the beginning.
#[inline(always)]
pub(super) const fn first_context(is_of_values: bool) -> usize {
    if is_of_values { behind_value(ZERO) } else { 0 }
}

/// The symbol of a cell.
#[inline(always)]
pub(super) fn symbol(cell: i64) -> usize {
    let place = cell.wrapping_add(ZERO as i64) as u64;
    if place < SYMBOLS as u64 { place as usize } else { ESCAPE }
}
