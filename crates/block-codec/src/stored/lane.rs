//! A reader's lane: its context, and the sums of what it read.

use super::alphabet::{LARGEST_SIZE, SIZE_FIELD, SMALLEST, ZERO, first_context};
use super::order::{Sums, VALUES};
use super::weights::{Entries, SLOT_BITS};
use super::words::Words;
use crate::rows::LARGEST;

/// What a lane's reader knows besides its state. `ORDER` is the kind of an order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lane<const ORDER: u8> {
    /// First slot of the table of its context.
    table: usize,
    /// -1 if differences are turned, otherwise 0.
    turn: i64,
    sums: Sums,
}

impl<const ORDER: u8> Lane<ORDER> {
    pub(super) const START: Self = Self {
        table: first_context(ORDER == VALUES) << SLOT_BITS,
        turn: 0,
        sums: Sums::START,
    };

    /// The next value, or the sum of all differences, or of all sums.
    #[inline(always)]
    pub(super) fn read<const LOW_BITS: bool>(
        &mut self,
        entries: &Entries,
        state: &mut u32,
        words: &mut Words<'_>,
        low: u32,
    ) -> i64 {
        let entry = entries.at(self.table, *state);
        *state = words.refilled(entry.advanced(*state));
        let mut cell = entry.cell();
        if cell == -(ZERO as i64) {
            // Copies, so that the state and the words themselves stay in registers.
            let (mut x, mut rest) = (*state, *words);
            cell = escaped(&mut x, &mut rest, low);
            (*state, *words) = (x, rest);
        }
        self.table = entry.next_table();
        let turned = if LOW_BITS {
            cell << low | words.long_raw(state, low) as i64
        } else {
            cell
        };
        let difference = (turned ^ self.turn) - self.turn;
        if ORDER != VALUES {
            self.turn ^= cell >> 63;
        }
        self.sums.add(ORDER, difference)
    }
}

/// A cell that has no symbol; zero if no writer writes so large a difference of differences, whose sums could overflow.
#[cold]
#[inline(never)]
fn escaped(state: &mut u32, words: &mut Words<'_>, low: u32) -> i64 {
    let field = words.raw(state, SIZE_FIELD) as u32;
    let bits = SMALLEST + field / 2;
    if bits <= LARGEST_SIZE {
        let size = 1 << bits | words.long_raw(state, bits);
        if size <= (8 * LARGEST as u64) >> low {
            return if field % 2 == 1 { -(size as i64) } else { size as i64 };
        }
    }
    words.refuse();
    0
}
