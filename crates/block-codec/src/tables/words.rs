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
pub(super) struct Steps {
    /// As long as there is room, and how many of them there are.
    all: Vec<u32>,
    count: usize,
}

const LANE_SHIFT: u32 = 30;
const RAW: u32 = 1 << 29;

impl Steps {
    pub(super) fn new() -> Self {
        Self {
            all: Vec::new(),
            count: 0,
        }
    }

    /// Makes room for so many further steps.
    pub(super) fn reserve(&mut self, steps: usize) {
        if self.all.len() < self.count + steps {
            self.all.resize(2 * self.count + steps, 0);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Appends a step, for which there must be room.
    #[inline(always)]
    pub(super) fn push(&mut self, lane: usize, step: Step) {
        let step = match step {
            Step::Symbol(part) => part.0,
            Step::Raw { value, bits } => RAW | bits << WORD_BITS | (value & ((1 << bits) - 1)) as u32,
        };
        self.all[self.count] = (lane as u32) << LANE_SHIFT | step;
        self.count += 1;
    }

    /// The states of the lanes at the beginning, the words with the last one first, and the number of pads. The steps from `tail_from` on
    /// are those of the tail.
    pub(super) fn encoded(&self, tail_from: usize) -> ([u32; LANES], Vec<u16>, u64) {
        let (lanes, tail) = self.all[..self.count].split_at(tail_from);
        // A step takes at most one word.
        let (mut words, mut count) = (vec![0; self.count + LANES * PADS], 0);
        let mut state = 1;
        for step in tail.iter().rev() {
            encode(*step, &mut state, &mut words, &mut count);
        }
        // The words that the states of the other lanes hold, and a whole state of the first.
        let mut pads = 0;
        while count < LANES - 1 || state < LOW {
            encode(RAW | WORD_BITS << WORD_BITS, &mut state, &mut words, &mut count);
            pads += 1;
        }
        count -= LANES - 1;
        let held = |place: usize| LOW | u32::from(words[count + place]);
        let mut states = [state, held(2), held(1), held(0)];
        for step in lanes.iter().rev() {
            encode(*step, &mut states[(step >> LANE_SHIFT) as usize], &mut words, &mut count);
        }
        words.truncate(count);
        (states, words, pads)
    }
}

/// More than the number of pads of a lane.
const PADS: usize = 2;

#[inline(always)]
fn encode(step: u32, state: &mut u32, words: &mut [u16], count: &mut usize) {
    let (is_raw, bits) = (step & RAW != 0, step >> WORD_BITS & 31);
    let part = Part(step & (RAW - 1));
    // Compared in 64 bits: no state reaches the limit of no bits, and that of a part of all slots.
    let limit = if is_raw {
        1 << (u32::BITS - bits)
    } else {
        u64::from(part.width()) << (u32::BITS - SLOT_BITS)
    };
    let is_full = u64::from(*state) >= limit;
    words[*count] = *state as u16;
    *count += usize::from(is_full);
    let x = select_unpredictable(is_full, *state >> WORD_BITS, *state);
    *state = if is_raw {
        x << bits | step & (LOW - 1)
    } else {
        let width = part.width();
        (x / width) << SLOT_BITS | (x % width + part.start())
    };
}

/// The words that all lanes read in turn.
#[derive(Debug, Clone, Copy)]
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
