//! Range asymmetric numeral systems: symbols in proportion to the slots that their table gives them, as words of 16 bits.
//!
//! A lane has a state of 32 bits, at least [`LOW`]. A symbol whose part begins at slot `start` and has `width` of the `2^SLOT_BITS` slots
//! moves a reader's state `x` to `width (x >> SLOT_BITS) + x mod 2^SLOT_BITS - start`; raw bits are the lowest ones of the state and are
//! shifted out. Afterwards a state below `LOW` takes the next word at its lower end. A writer does the inverse from the last step to the first.

use std::hint::select_unpredictable;

/// Lanes that are coded side by side.
pub(super) const LANES: usize = 4;
/// Smallest state.
pub(super) const LOW: u32 = 1 << WORD_BITS;
const WORD_BITS: u32 = 16;
/// A table has `2^SLOT_BITS` slots.
pub(super) const SLOT_BITS: u32 = 10;
pub(super) const SLOTS: usize = 1 << SLOT_BITS;

/// A symbol's slots in its table: the first of them and their number.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Part(u32);

impl Part {
    #[inline(always)]
    pub(super) fn new(start: u32, width: u32) -> Self {
        Self(start << WORD_BITS | width)
    }

    #[inline(always)]
    pub(super) fn start(self) -> u32 {
        self.0 >> WORD_BITS
    }

    #[inline(always)]
    pub(super) fn width(self) -> u32 {
        self.0 & (LOW - 1)
    }
}

/// What one step of a lane codes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    Symbol(Part),
    /// The low bits of a number, at most 16.
    Raw {
        value: u64,
        bits: u32,
    },
}

/// Steps in the order of a reader: lane (2 bits), whether they are raw (1 bit), number of raw bits or start, value or width.
#[derive(Debug)]
pub(super) struct Steps(Vec<u32>);

const LANE_SHIFT: u32 = 30;
const RAW: u32 = 1 << 29;

impl Steps {
    pub(super) fn with_capacity(steps: usize) -> Self {
        Self(Vec::with_capacity(steps))
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    pub(super) fn push(&mut self, lane: usize, step: Step) {
        let step = match step {
            Step::Symbol(part) => part.0,
            Step::Raw { value, bits } => RAW | bits << WORD_BITS | (value & ((1 << bits) - 1)) as u32,
        };
        self.0.push((lane as u32) << LANE_SHIFT | step);
    }

    /// The states of the lanes at the beginning, the words with the last one first, and the number of pads. The steps from `tail_from` on
    /// are those of the tail.
    pub(super) fn encoded(&self, tail_from: usize) -> ([u32; LANES], Vec<u16>, u64) {
        let (lanes, tail) = self.0.split_at(tail_from);
        let mut words = Vec::with_capacity(self.0.len() / 4 + 16);
        let mut state = 1;
        for step in tail.iter().rev() {
            encode(*step, &mut state, &mut words);
        }
        // The words that the states of the other lanes hold, and a whole state of the first.
        let mut pads = 0;
        while words.len() < LANES - 1 || state < LOW {
            encode(RAW | WORD_BITS << WORD_BITS, &mut state, &mut words);
            pads += 1;
        }
        let mut held = || LOW | u32::from(words.pop().unwrap_or(0));
        let mut states = [state, held(), held(), held()];
        for step in lanes.iter().rev() {
            encode(*step, &mut states[(step >> LANE_SHIFT) as usize], &mut words);
        }
        (states, words, pads)
    }
}

#[inline(always)]
fn encode(step: u32, state: &mut u32, words: &mut Vec<u16>) {
    if step & RAW != 0 {
        let bits = step >> WORD_BITS & 31;
        // Compared without the shift overflowing at no bits.
        if u64::from(*state) >= 1 << (u32::BITS - bits) {
            words.push(*state as u16);
            *state >>= WORD_BITS;
        }
        *state = *state << bits | step & (LOW - 1);
    } else {
        let part = Part(step & (RAW - 1));
        let width = part.width();
        // A part of all slots is reached by no state.
        if u64::from(*state) >= u64::from(width) << (u32::BITS - SLOT_BITS) {
            words.push(*state as u16);
            *state >>= WORD_BITS;
        }
        *state = (*state / width) << SLOT_BITS | (*state % width + part.start());
    }
}

/// The words that all lanes read in turn.
#[derive(Debug)]
pub(super) struct Words<'a> {
    words: &'a [[u8; 2]],
    position: usize,
    broken: bool,
}

impl<'a> Words<'a> {
    pub(super) fn new(words: &'a [[u8; 2]]) -> Self {
        Self {
            words,
            position: 0,
            broken: false,
        }
    }

    /// Notes that what was read is not what a writer writes.
    pub(super) fn refuse(&mut self) {
        self.broken = true;
    }

    pub(super) fn is_broken(&self) -> bool {
        self.broken
    }

    pub(super) fn is_finished(&self) -> bool {
        self.position == self.words.len()
    }

    /// These words and then those that were not read.
    pub(super) fn behind(&self, first: impl Iterator<Item = u16>) -> Vec<[u8; 2]> {
        let rest = self.words[self.position..].iter().copied();
        first.map(u16::to_le_bytes).chain(rest).collect()
    }

    #[inline(always)]
    fn refilled(&mut self, state: u32) -> u32 {
        let Some(word) = self.words.get(self.position) else {
            return state;
        };
        let is_short = state < LOW;
        self.position += usize::from(is_short);
        select_unpredictable(is_short, state << WORD_BITS | u32::from(u16::from_le_bytes(*word)), state)
    }

    /// Moves a state in `slot` behind the symbol with this part.
    #[inline(always)]
    pub(super) fn advance(&mut self, state: &mut u32, part: Part) {
        let slot = *state % SLOTS as u32;
        *state = self.refilled((part.width() * (*state >> SLOT_BITS)).wrapping_add(slot.wrapping_sub(part.start())));
    }

    /// At most 16 raw bits.
    #[inline(always)]
    pub(super) fn raw(&mut self, state: &mut u32, bits: u32) -> u64 {
        let value = *state & ((1 << bits) - 1);
        *state = self.refilled(*state >> bits);
        u64::from(value)
    }

    /// Raw bits, the lowest 16 first.
    #[inline(always)]
    pub(super) fn long_raw(&mut self, state: &mut u32, bits: u32) -> u64 {
        let (mut value, mut done) = (0, 0);
        while done < bits {
            let count = (bits - done).min(WORD_BITS);
            value |= self.raw(state, count) << done;
            done += count;
        }
        value
    }
}

/// The steps of raw bits, the lowest 16 first.
#[inline(always)]
pub(super) fn raw_steps(value: u64, bits: u32, mut push: impl FnMut(Step)) {
    let mut done = 0;
    while done < bits {
        let count = (bits - done).min(WORD_BITS);
        push(Step::Raw {
            value: value >> done,
            bits: count,
        });
        done += count;
    }
}
