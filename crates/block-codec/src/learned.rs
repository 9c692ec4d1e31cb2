//! Reads indices that were coded by tables of symbols which learn. Writers store tables (module `stored`), which are read at twice the speed.
//!
//! The first [`WARM`] differences are coded by counts. All further ones are symbols under tables that follow from the symbols so far. Lanes,
//! stretches, tail and orders are those of module `stored`; a table has 1024 slots, and of values `k` is at most 15.
//!
//! ```text
//! 32 w + 8 m + p varint   w: bytes of the arithmetic code; m: number of words modulo 4; p: pads
//! w bytes                 arithmetic code: first index and second differences or not, as in counts; k (6 bits; from 48 on: 48 less, of values,
//!                         followed by their centre in the form of a first index); WARM differences by counts
//! 4 x 4 bytes             states of the lanes, little-endian
//! words of 2 bytes        little-endian, as the lanes need them
//!
//! tail                    t = 80 * WARM / 8w rows, at least 8 and at most 8 + r / 16 of the remaining r
//! every PERIOD rows of each lane in a stretch   tables are made anew where they are due
//!
//! symbol 0                a symbol that has no slot: 6 raw bits tell which; if these are 0, 50 raw bits hold the cell in zigzag form
//!        1 to 31          cells -15 to 15
//!        32 to 63         cells of size 2^e to 2^(e + 1) - 1, e = 4 to 19: 32 + 2 (e - 4), one more if positive; e raw bits are the rest of the size
//! ```
//!
//! Contexts: while the cell is zero, for how many rows (1, 2, 3 to 4, 5 to 8, 9 to 16, more; 1 also at the beginning); otherwise its size (1, 2, 3, more) and whether the
//! cell before was of the other sign, zero, of the same. Values are not turned. Their contexts are the size of the last cell (0 to 4, 5 to 6,
//! 7 to 9, 10 to 13, more; more also behind symbol 0) and its sign (minus behind symbol 0); at the beginning 0.

use crate::arithmetic::{Coder, Reader};
use crate::bytes::{Bytes, unzigzag};
use crate::counts::Counts;
use crate::error::{Damaged, ensure};
use crate::indices::code_first;
use crate::rows::{LARGEST, code_all};
use crate::stored::alphabet::size_class;
use crate::stored::order::{Order, Sums, VALUES};
use crate::stored::words::{HEAD_BITS, LANES, Words, fill_slots, stretches};

/// Number of differences that are coded by counts.
const WARM: usize = 256;
/// Rows of each lane between two looks at the tables.
const PERIOD: usize = 32;
const LEARNED_ROWS: usize = 2048;
/// Bits that a tail should take.
const TAIL_BITS: usize = 80;
const MOST_LOW: u32 = 45;
const LOW_FIELD: u32 = 6;
/// Numbers of low bits from here on say that values are coded, of fewer low bits.
const OF_VALUES: u32 = 48;

const SYMBOLS: usize = 64;
const SYMBOL_BITS: u32 = 6;
const ESCAPE: usize = 0;
const ZERO: usize = 16;
const RANGES: usize = 32;
const RANGE_BITS: u32 = 4;
const WHOLE_BITS: u32 = 50;
const CONTEXTS: usize = 18;
const SLOT_BITS: u32 = 10;
const SLOTS: usize = 1 << SLOT_BITS;

/// Weight of the frequencies of all contexts in each, in symbols.
const COMMON: f32 = 24.0;
/// Weight of the symbol 0 beside them, in symbols of `2^-8`.
const ESCAPED: i32 = 128;
/// A table is made anew if so many symbols were added since, and one in `GROWTH`.
const FEW: u16 = 8;
const GROWTH: u16 = 5;
/// Number of symbols from which on counts are halved when a table is made.
const MOST: u16 = 1024;

/// The last cells of a lane.
#[derive(Clone, Copy, Default)]
struct Lane {
    /// Number of zero cells, less one.
    rests: usize,
    /// Size of the last cell up to four, and the sign of the cell before beside it (0 the other, 1 zero, 2 the same).
    size: usize,
    before: usize,
    /// The context of values.
    class: usize,
    is_turned: bool,
}

impl Lane {
    const START: Self = Self {
        rests: 0,
        size: 0,
        before: 0,
        class: 8,
        is_turned: false,
    };

    fn context(self, of_values: bool) -> usize {
        match (self.size, self.rests) {
            _ if of_values => self.class,
            (0, 0..=1) => self.rests,
            (0, 2..=3) => 2,
            (0, 4..=7) => 3,
            (0, 8..=15) => 4,
            (0, _) => 5,
            (size, _) => 3 + 3 * size + self.before,
        }
    }

    fn follow(&mut self, symbol: usize, is_negative: bool) {
        let is_cell = (1..RANGES).contains(&symbol);
        let size = if is_cell { symbol.abs_diff(ZERO) } else { SYMBOLS };
        let is_up = if is_cell { symbol > ZERO } else { symbol % 2 == 1 };
        let class = size_class(size);
        self.class = if is_up { 8 + class } else { 8 - class };
        let was_zero = self.size == 0;
        self.rests = if was_zero && size == 0 { self.rests + 1 } else { 0 };
        self.before = match (was_zero, is_up || symbol == ESCAPE) {
            (true, _) => 1,
            (_, true) => 2,
            _ => 0,
        };
        self.size = size.min(4);
        self.is_turned ^= is_negative;
    }
}

/// Tables of all contexts.
struct Tables {
    of_values: bool,
    low: u32,
    counts: [[u16; SYMBOLS]; CONTEXTS],
    /// Sums of the counts when the tables were made, and how many symbols were added since.
    sums: [u16; CONTEXTS],
    added: [u16; CONTEXTS],
    widths: [[u32; SYMBOLS]; CONTEXTS],
}

impl Tables {
    /// Tables after these differences.
    fn new(differences: &[i64], of_values: bool, low: u32) -> Self {
        let mut tables = Self {
            of_values,
            low,
            counts: [[0; SYMBOLS]; CONTEXTS],
            sums: [0; CONTEXTS],
            added: [0; CONTEXTS],
            widths: [[0; SYMBOLS]; CONTEXTS],
        };
        let mut lane = Lane::START;
        for difference in differences {
            let cell = tables.turned(*difference, lane) >> low;
            let size = cell.unsigned_abs();
            let symbol = if size < ZERO as u64 {
                (cell + ZERO as i64) as usize
            } else {
                let symbol = RANGES + 2 * (size.ilog2() - RANGE_BITS) as usize + usize::from(cell > 0);
                if symbol < SYMBOLS { symbol } else { ESCAPE }
            };
            tables.counts[lane.context(of_values)][symbol] += 1;
            lane.follow(symbol, cell < 0);
        }
        tables.renew_if(|_, _| true);
        tables
    }

    fn turned(&self, difference: i64, lane: Lane) -> i64 {
        if lane.is_turned && !self.of_values {
            -difference
        } else {
            difference
        }
    }

    /// The next difference.
    fn read(&mut self, lane: &mut Lane, state: &mut u32, words: &mut Words<'_>) -> i64 {
        let context = lane.context(self.of_values);
        let (slot, mut start, mut symbol) = (*state % SLOTS as u32, 0, 0);
        let widths = &self.widths[context];
        while slot >= start + widths[symbol] {
            start += widths[symbol];
            symbol += 1;
        }
        *state = words.refilled(widths[symbol] * (*state >> SLOT_BITS) + slot - start);
        let is_escaped = symbol == ESCAPE;
        if is_escaped {
            symbol = words.raw(state, SYMBOL_BITS) as usize;
        }
        let mut cell = symbol as i64 - ZERO as i64;
        if symbol == ESCAPE {
            cell = unzigzag(words.long_raw(state, WHOLE_BITS));
        } else if symbol >= RANGES {
            let bits = RANGE_BITS + (symbol - RANGES) as u32 / 2;
            let size = (1 << bits | words.long_raw(state, bits)) as i64;
            cell = if symbol % 2 == 1 { size } else { -size };
        }
        // No writer writes so large a difference of differences, whose sums could overflow.
        if cell.unsigned_abs() > (8 * LARGEST as u64) >> self.low {
            words.refuse();
            cell = 0;
        }
        self.counts[context][symbol] += 1;
        self.added[context] += 1;
        let turned = cell << self.low | words.long_raw(state, self.low) as i64;
        let difference = self.turned(turned, *lane);
        lane.follow(symbol, cell < 0);
        difference
    }

    /// Makes those tables anew that are due, by the sum of counts when they were made and what was added.
    fn renew_if(&mut self, is_due: impl Fn(u16, u16) -> bool) {
        let due: Vec<usize> = (0..CONTEXTS)
            .filter(|at| is_due(self.sums[*at], self.added[*at]))
            .collect();
        if due.is_empty() {
            return;
        }
        let all: [u16; SYMBOLS] = std::array::from_fn(|symbol| self.counts.iter().map(|counts| counts[symbol]).sum());
        let common = common(&all);
        for at in due {
            let counts = &mut self.counts[at];
            self.widths[at] = widths(counts, &common);
            if counts.iter().sum::<u16>() > MOST {
                counts.iter_mut().for_each(|count| *count /= 2);
            }
            (self.sums[at], self.added[at]) = (counts.iter().sum(), 0);
        }
    }
}

/// The frequencies of all contexts together in symbols of `2^-8`, of which there are [`COMMON`]. A tenth of those of cells is moved to each
/// neighbour.
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
fn widths(counts: &[u16; SYMBOLS], common: &[i32; SYMBOLS]) -> [u32; SYMBOLS] {
    let weights: [i32; SYMBOLS] = std::array::from_fn(|symbol| (i32::from(counts[symbol]) << 8) + common[symbol]);
    let share = (4 * SLOTS) as f32 / weights.iter().sum::<i32>() as f32;
    let mut widths = std::array::from_fn(|symbol| {
        let quarters = (weights[symbol] as f32 * share) as i32;
        let least = i32::from(quarters > 0) | i32::from(counts[symbol] > 0);
        ((quarters + 2) >> 2).max(least) as u32
    });
    widths[ESCAPE] = widths[ESCAPE].max(1);
    fill_slots(&mut widths, SLOTS);
    widths
}

/// The indices of a block without its head.
pub(crate) fn read(bytes: &[u8], rows: usize) -> Result<Vec<i64>, Damaged> {
    ensure!(rows >= LEARNED_ROWS, Damaged::new("block", format!("tables for {rows} rows"), "2048 rows or more"));
    let mut bytes = Bytes(bytes);
    let head = bytes.varint()?;
    let warm = bytes.take(usize::try_from(head >> HEAD_BITS).unwrap_or(usize::MAX))?;
    let mut reader = Reader::new(warm);
    let (first, mut has_rests) = code_first(&mut reader, None, false)?;
    let second = reader.raw(0, 1) == 1;
    let mut low = reader.raw(0, LOW_FIELD) as u32;
    let (mut kind, mut centre) = (u8::from(second), 0);
    let of_values = low >= OF_VALUES;
    if of_values {
        let (found, rests) = code_first(&mut reader, None, false)?;
        has_rests |= rests || second;
        (kind, centre, low) = (VALUES, found, low - OF_VALUES);
    }
    let expected = "at most 45, or of values, behind a first index of at most 2^46 in size";
    ensure!(!has_rests && low <= MOST_LOW, Damaged::new("low bits", low, expected));
    let order = Order { kind, centre };
    let mut indices = code_all(&mut reader, Counts::new(first, second), None, WARM + 1, None)?;
    reader.finish()?;
    let mut tables = Tables::new(&order.differences(&indices), of_values, low);
    let push = |indices: &mut Vec<i64>, mut found: Vec<i64>| {
        let mut sums = Sums::START;
        found.iter_mut().for_each(|own| *own = sums.add(kind, *own));
        order.push(indices, &found)
    };
    let (mut states, mut words) = Words::begun(bytes, head)?;
    let rest = rows - indices.len();
    let tail = (TAIL_BITS * WARM / (8 * warm.len().max(1))).clamp(8, 8 + rest / 16);
    for length in stretches(rest - tail.min(rest)) {
        let (mut lanes, mut found) = ([Lane::START; LANES], vec![0; LANES * length]);
        for row in 0..length {
            for (lane, (context, state)) in lanes.iter_mut().zip(&mut states).enumerate() {
                found[lane * length + row] = tables.read(context, state, &mut words);
            }
            if (row + 1) % PERIOD == 0 || row + 1 == length {
                tables.renew_if(|sum, added| added >= FEW && GROWTH * added >= sum + added);
            }
        }
        words.check(&states)?;
        push(&mut indices, found)?;
    }
    let mut lane = Lane::START;
    let found = words.tail(&states, head, rows - indices.len(), |state, words| tables.read(&mut lane, state, words))?;
    push(&mut indices, found)?;
    Ok(indices)
}
