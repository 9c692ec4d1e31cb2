//! Range asymmetric numeral systems: symbols in proportion to the slots that their table gives them, as words of 16 bits.
//!
//! A lane has a state of 32 bits, at least [`LOW`]. A symbol whose part begins at slot `start` and has `width` of the `2^b` slots of its
//! table moves a reader's state `x` to `width (x >> b) + x mod 2^b - start`; raw bits are the lowest ones of the state and are
//! shifted out. Afterwards a state below `LOW` takes the next word at its lower end. A writer does the inverse from the last step to the first.

use crate::bytes::Bytes;
use crate::error::{Damaged, ensure};
use std::hint::select_unpredictable;

/// Lanes that are coded side by side.
pub(crate) const LANES: usize = 4;
/// Smallest state.
pub(crate) const LOW: u32 = 1 << WORD_BITS;
pub(crate) const WORD_BITS: u32 = 16;
/// Rows of a stretch.
pub(crate) const STRETCH: usize = 512;
/// Bits of the number of pads (words of three lanes and the state of the first one), and of that and the number of words modulo 4. Without
/// the latter, a word too many or too few is rarely taken for a part of other rows.
pub(crate) const PAD_BITS: u32 = 3;
pub(crate) const HEAD_BITS: u32 = PAD_BITS + 2;

/// Lengths of the stretches that four lanes take at a time.
pub(crate) fn stretches(rows: usize) -> impl DoubleEndedIterator<Item = usize> {
    let full = rows / (LANES * STRETCH);
    let rest = (rows - full * LANES * STRETCH) / LANES;
    std::iter::repeat_n(STRETCH, full).chain((rest > 0).then_some(rest))
}

/// Makes the widths of symbols (of at most 64) fill all slots: the largest gives or takes what is left. While there are too many it has
/// `slots / 64` at least, so each round takes some.
#[inline(always)]
pub(crate) fn fill_slots(widths: &mut [u32], slots: usize) {
    let mut over = widths.iter().sum::<u32>() as i32 - slots as i32;
    while over != 0 {
        // Width and place of the first of the largest ones in one number.
        let ranked = widths.iter().zip((0..64).rev());
        let largest = ranked.fold(0, |most, (width, place)| most.max(width << 6 | place));
        let width = &mut widths[63 - largest as usize % 64];
        let taken = over.min(*width as i32 / 2);
        *width = width.wrapping_add_signed(-taken);
        over -= taken;
    }
}

fn cut_off() -> Damaged {
    Damaged::new("block", "other words", "those that a writer of as many rows wrote")
}

/// The words that all lanes read in turn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words<'a> {
    words: &'a [[u8; 2]],
    position: usize,
    broken: bool,
}

impl<'a> Words<'a> {
    fn new(words: &'a [[u8; 2]]) -> Self {
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

    /// The states of the lanes and the words behind them, whose number modulo 4 the head states.
    pub(crate) fn begun(mut bytes: Bytes<'a>, head: u64) -> Result<([u32; LANES], Self), Damaged> {
        let mut states = [0; LANES];
        for state in &mut states {
            *state = u32::from_le_bytes(bytes.array()?);
        }
        let (words, odd) = bytes.0.as_chunks();
        ensure!(odd.is_empty() && words.len() as u64 % 4 == head >> PAD_BITS & 3, cut_off());
        Ok((states, Self::new(words)))
    }

    /// Number of all words.
    pub(crate) fn count(&self) -> usize {
        self.words.len()
    }

    /// Checks what four stretches leave, so that time and memory are in proportion to the bytes.
    pub(crate) fn check(&self, states: &[u32; LANES]) -> Result<(), Damaged> {
        ensure!(!self.broken && states.iter().all(|state| *state >= LOW), cut_off());
        Ok(())
    }

    /// The rows of the tail, one by one as `read` reads them from its state and words: those that the states of the lanes 1 to 3 hold, and those
    /// that were not read. The head states how many pads, which are zero, come before them.
    pub(crate) fn tail(
        self,
        states: &[u32; LANES],
        head: u64,
        rows: usize,
        mut read: impl FnMut(&mut u32, &mut Words<'_>) -> i64,
    ) -> Result<Vec<i64>, Damaged> {
        let ([mut state, held @ ..], rest) = (*states, &self.words[self.position..]);
        ensure!(held.iter().all(|state| *state < 2 * LOW), cut_off());
        let held = held.map(|state| (state as u16).to_le_bytes());
        let all = [&held, rest].concat();
        let mut words = Words::new(&all);
        let pads = (0..head & ((1 << PAD_BITS) - 1)).fold(0, |all, _| all | words.raw(&mut state, WORD_BITS));
        let found = (0..rows).map(|_| read(&mut state, &mut words)).collect();
        let is_ended = pads == 0 && !words.broken && words.position == words.words.len() && state == 1;
        ensure!(is_ended, cut_off());
        Ok(found)
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
