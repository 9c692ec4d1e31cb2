//! Range asymmetric numeral systems: symbols in proportion to the slots that their table gives them, as words of 16 bits.
//!
//! A lane has a state of 32 bits, at least [`LOW`]. A symbol whose part begins at slot `start` and has `width` of the `2^SLOT_BITS` slots
//! moves a reader's state `x` to `width (x >> SLOT_BITS) + x mod 2^SLOT_BITS - start`; raw bits are the lowest ones of the state and are
//! shifted out. Afterwards a state below `LOW` takes the next word at its lower end. A writer does the inverse from the last step to the first.

use std::hint::select_unpredictable;

/// Lanes that are coded side by side.
pub(crate) const LANES: usize = 4;
/// Smallest state.
pub(crate) const LOW: u32 = 1 << WORD_BITS;
pub(crate) const WORD_BITS: u32 = 16;
/// A table has `2^SLOT_BITS` slots.
pub(crate) const SLOT_BITS: u32 = 10;
pub(crate) const SLOTS: usize = 1 << SLOT_BITS;

/// A symbol's slots in its table: the first of them and their number.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Part(u32);

impl Part {
    #[inline(always)]
    pub(crate) fn new(start: u32, width: u32) -> Self {
        Self(start << WORD_BITS | width)
    }

    #[inline(always)]
    pub(crate) fn start(self) -> u32 {
        self.0 >> WORD_BITS
    }

    #[inline(always)]
    pub(crate) fn width(self) -> u32 {
        self.0 & (LOW - 1)
    }
}

/// The words that all lanes read in turn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words<'a> {
    words: &'a [[u8; 2]],
    position: usize,
    broken: bool,
}

impl<'a> Words<'a> {
    pub(crate) fn new(words: &'a [[u8; 2]]) -> Self {
        Self {
            words,
            position: 0,
            broken: false,
        }
    }

    /// Notes that what was read is not what a writer writes.
    pub(crate) fn refuse(&mut self) {
        self.broken = true;
    }

    pub(crate) fn is_broken(&self) -> bool {
        self.broken
    }

    pub(crate) fn is_finished(&self) -> bool {
        self.position == self.words.len()
    }

    /// These words and then those that were not read.
    pub(crate) fn behind(&self, first: impl Iterator<Item = u16>) -> Vec<[u8; 2]> {
        let rest = self.words[self.position..].iter().copied();
        first.map(u16::to_le_bytes).chain(rest).collect()
    }

    #[inline(always)]
    pub(crate) fn refilled(&mut self, state: u32) -> u32 {
        let Some(word) = self.words.get(self.position) else {
            return state;
        };
        let is_short = state < LOW;
        self.position += usize::from(is_short);
        select_unpredictable(is_short, state << WORD_BITS | u32::from(u16::from_le_bytes(*word)), state)
    }

    /// Moves a state in `slot` behind the symbol with this part.
    #[inline(always)]
    pub(crate) fn advance(&mut self, state: &mut u32, part: Part) {
        let slot = *state % SLOTS as u32;
        *state = self.refilled((part.width() * (*state >> SLOT_BITS)).wrapping_add(slot.wrapping_sub(part.start())));
    }

    /// At most 16 raw bits.
    #[inline(always)]
    pub(crate) fn raw(&mut self, state: &mut u32, bits: u32) -> u64 {
        let value = *state & ((1 << bits) - 1);
        *state = self.refilled(*state >> bits);
        u64::from(value)
    }

    /// Raw bits, the lowest 16 first.
    #[inline(always)]
    pub(crate) fn long_raw(&mut self, state: &mut u32, bits: u32) -> u64 {
        let (mut value, mut done) = (0, 0);
        while done < bits {
            let count = (bits - done).min(WORD_BITS);
            value |= self.raw(state, count) << done;
            done += count;
        }
        value
    }
}
