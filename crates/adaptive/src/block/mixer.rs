//! The probability of one decision: counts in contexts and laws of experts, mixed in the logistic domain.
//!
//! ```text
//! log odds = sum_i w_i s_i          s_i: log odds that context or expert i gives; w_i: by class of decision, and confidence of a context
//! w_i <- w_i + rate (bit - p) s_i   the gradient of the code length
//! ```

use super::elementary::{log2, squash};
use super::priors::MIXER_WEIGHTS;
use std::sync::LazyLock;

/// Contexts whose outcomes are counted.
pub(super) const CONTEXTS: usize = 6;
/// Experts that predict the index.
pub(super) const EXPERTS: usize = 4;
/// Classes of how often a context was seen.
const CONFIDENCES: usize = 5;
/// Weights of one class of decisions; the last is that of a constant.
const STRIDE: usize = CONTEXTS * CONFIDENCES + EXPERTS + 1;
/// Classes of decisions: zero, sign, three magnitudes, further ones, inside an interval, low bits.
pub(super) const CLASSES: usize = 8;
/// All weights.
pub(super) const WEIGHTS: usize = CLASSES * STRIDE;
/// The constant input.
const CONSTANT: f32 = 0.4;
/// Log odds of a decision are within these bits.
const FARTHEST: f32 = 15.0;
/// Learning rate of the weights in the long run, its factor at the start, and the decisions over which it falls.
const RATE: f32 = 0.0015;
const FIRST_RATES: f32 = 6.0;
const RATE_FALLS: f32 = 32.0;
/// Occurrences after which a context forgets.
const MOST_SEEN: u8 = 60;

/// Outcomes of a decision in one context.
#[derive(Debug, Clone, Copy, Default)]
struct Slot {
    /// Probability of `true` in units of `2^-16`.
    one: u16,
    seen: u8,
    /// A few bits of the hash, never 0.
    check: u8,
}

/// Confidence of a context that was seen so often.
const CONFIDENCE: [u8; MOST_SEEN as usize + 1] = {
    let mut classes = [4; MOST_SEEN as usize + 1];
    let mut seen = 0;
    while seen < 12 {
        classes[seen] = match seen {
            0 => 0,
            1 => 1,
            2 | 3 => 2,
            _ => 3,
        };
        seen += 1;
    }
    classes
};

/// Log odds of probabilities in units of `2^-12`.
static LOG_ODDS: LazyLock<Box<[f32; 4096]>> = LazyLock::new(|| {
    Box::new(std::array::from_fn(|i| {
        let p = (i as f32 + 0.5) / 4096.0;
        log2(p) - log2(1.0 - p)
    }))
});

/// Log odds of two shares of a probability.
#[inline(always)]
pub(super) fn log_odds(yes: f32, no: f32) -> f32 {
    const LEAST: f32 = 1e-9;
    (log2(yes.max(LEAST)) - log2(no.max(LEAST))).clamp(-12.0, 12.0)
}

/// Contexts, experts' inputs and weights.
#[derive(Debug, Clone)]
pub(super) struct Mixer {
    slots: Vec<Slot>,
    mask: usize,
    /// Hashes of the contexts of this slot.
    pub(super) contexts: [u32; CONTEXTS],
    /// Log odds that the experts give, to be set before each decision.
    pub(super) experts: [f32; EXPERTS],
    pub(super) weights: Box<[f32; WEIGHTS]>,
    decisions: [u32; CLASSES],
    class: usize,
    chosen: [usize; CONTEXTS],
    inputs: [f32; CONTEXTS],
    rows: [usize; CONTEXTS],
    p: f32,
}

impl Mixer {
    /// For a block of so many rows.
    pub(super) fn new(rows: usize) -> Self {
        let size = (2 * rows).next_power_of_two().clamp(1 << 9, 1 << 14);
        Self {
            slots: vec![Slot::default(); CONTEXTS * size],
            mask: size - 1,
            contexts: [0; CONTEXTS],
            experts: [0.0; EXPERTS],
            weights: Box::new(MIXER_WEIGHTS),
            decisions: [0; CLASSES],
            class: 0,
            chosen: [0; CONTEXTS],
            inputs: [0.0; CONTEXTS],
            rows: [0; CONTEXTS],
            p: 0.5,
        }
    }

    /// The slot of a hash: one of two neighbours; if neither is of this hash, the less seen is given up.
    #[inline(always)]
    fn find(&mut self, context: usize, hash: u32) -> usize {
        let base = context * (self.mask + 1);
        let first = base + (hash as usize & self.mask);
        let check = (hash >> 24) as u8 | 1;
        if self.slots[first].check == check {
            return first;
        }
        let second = first ^ 1;
        if self.slots[second].check == check {
            return second;
        }
        let given_up = if self.slots[first].seen <= self.slots[second].seen {
            first
        } else {
            second
        };
        self.slots[given_up] = Slot {
            one: 1 << 15,
            seen: 0,
            check,
        };
        given_up
    }

    /// Probability that the decision `node`, of a class, is `true`: in units of `2^-16`, in `1..2^16`.
    #[inline(always)]
    pub(super) fn predict(&mut self, node: u32, class: usize) -> u32 {
        let table = &**LOG_ODDS;
        let start = class * STRIDE;
        self.class = class;
        let salt = (node + 1).wrapping_mul(0x9E37_79B1);
        let mut sum = CONSTANT * self.weights[start + STRIDE - 1];
        for c in 0..CONTEXTS {
            let hash = (self.contexts[c] ^ salt).wrapping_mul(0x85EB_CA6B);
            let at = self.find(c, hash ^ hash >> 15);
            let slot = self.slots[at];
            self.chosen[c] = at;
            self.rows[c] = start + c * CONFIDENCES + usize::from(CONFIDENCE[usize::from(slot.seen)]);
            self.inputs[c] = if slot.seen == 0 {
                0.0
            } else {
                table[usize::from(slot.one >> 4)]
            };
            sum += self.weights[self.rows[c]] * self.inputs[c];
        }
        for e in 0..EXPERTS {
            sum += self.weights[start + CONTEXTS * CONFIDENCES + e] * self.experts[e];
        }
        self.p = squash(sum.clamp(-FARTHEST, FARTHEST));
        ((self.p * 65536.0) as u32).clamp(1, 65535)
    }

    /// Learns the outcome of the decision just predicted.
    #[inline(always)]
    pub(super) fn update(&mut self, bit: bool) {
        let (start, seen) = (self.class * STRIDE, self.decisions[self.class]);
        self.decisions[self.class] = seen.saturating_add(1);
        let rate = RATE * (1.0 + FIRST_RATES / (1.0 + seen as f32 * (1.0 / RATE_FALLS)));
        let change = rate * (f32::from(u8::from(bit)) - self.p);
        for c in 0..CONTEXTS {
            self.weights[self.rows[c]] += change * self.inputs[c];
        }
        for e in 0..EXPERTS {
            self.weights[start + CONTEXTS * CONFIDENCES + e] += change * self.experts[e];
        }
        self.weights[start + STRIDE - 1] += change * CONSTANT;
        // A context seen for the first time starts from what all others said.
        let mixed = ((self.p * 65536.0) as i32).clamp(256, 65280);
        let target = if bit { 65535 } else { 0 };
        for at in self.chosen {
            let slot = &mut self.slots[at];
            let one = if slot.seen == 0 { mixed } else { i32::from(slot.one) };
            let moved = one + (target - one) * 2 / (2 * i32::from(slot.seen) + 3);
            slot.one = moved.clamp(16, 65520) as u16;
            slot.seen = (slot.seen + 1).min(MOST_SEEN);
        }
    }
}
