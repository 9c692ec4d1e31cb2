//! The probability of one decision: counts in contexts and laws of experts, mixed in the logistic domain.
//!
//! ```text
//! log odds = sum_i w_i s_i          s_i: log odds that context or expert i gives; w_i: by class of decision, and confidence of a context
//! w_i <- w_i + rate (bit - p) s_i   the gradient of the code length
//! ```

use super::priors::MIXER_WEIGHTS;
use fewbits_node::elementary::{greater, log2, squash};
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

/// Log odds of two shares of a probability, for each expert.
#[inline(always)]
pub(super) fn log_odds(yes: [f32; EXPERTS], no: [f32; EXPERTS]) -> [f32; EXPERTS] {
    const LEAST: f32 = 1e-9;
    let mut logs = [[0.0; EXPERTS]; 2];
    for (logs, shares) in logs.iter_mut().zip([yes, no]) {
        for e in 0..EXPERTS {
            logs[e] = log2(greater(shares[e], LEAST));
        }
    }
    let mut odds = [0.0; EXPERTS];
    for e in 0..EXPERTS {
        odds[e] = (logs[0][e] - logs[1][e]).clamp(-12.0, 12.0);
    }
    odds
}

/// `2^16 / (2 n + 3)`: the share, in units of `2^-15`, by which a context that was seen `n` times follows its next outcome.
const SHARES: [i32; MOST_SEEN as usize + 1] = {
    let mut shares = [0; MOST_SEEN as usize + 1];
    let mut seen = 0;
    while seen < shares.len() {
        shares[seen] = (1 << 16) / (2 * seen as i32 + 3);
        seen += 1;
    }
    shares
};

/// Contexts, experts' inputs and weights.
#[derive(Debug, Clone)]
pub(super) struct Mixer {
    log_odds: &'static [f32; 4096],
    slots: Vec<Slot>,
    mask: usize,
    /// Hashes of the contexts of this slot.
    pub(super) contexts: [u32; CONTEXTS],
    /// Log odds that the experts give, to be set before each decision.
    pub(super) experts: [f32; EXPERTS],
    pub(super) weights: Box<[f32; WEIGHTS]>,
    decisions: [u32; CLASSES],
    class: usize,
    /// Slots of the decision looked up, and where they are kept.
    held: [Slot; CONTEXTS],
    chosen: [usize; CONTEXTS],
    inputs: [f32; CONTEXTS],
    rows: [usize; CONTEXTS],
    p: f32,
}

impl Mixer {
    /// For a block of so many rows.
    pub(super) fn new(rows: usize) -> Self {
        let size = (2 * rows.min(1 << 13)).next_power_of_two().max(1 << 9);
        Self {
            log_odds: &LOG_ODDS,
            slots: vec![Slot::default(); CONTEXTS * size],
            mask: size - 1,
            contexts: [0; CONTEXTS],
            experts: [0.0; EXPERTS],
            weights: Box::new(MIXER_WEIGHTS),
            decisions: [0; CLASSES],
            class: 0,
            held: [Slot::default(); CONTEXTS],
            chosen: [0; CONTEXTS],
            inputs: [0.0; CONTEXTS],
            rows: [0; CONTEXTS],
            p: 0.5,
        }
    }

    /// Finds what the contexts say about the decision `node`, of a class. The experts' inputs can be computed while memory is waited for.
    ///
    /// Decisions of one context lie side by side, sixteen in a line of the cache. A slot is one of two neighbours; if neither is of this
    /// context, the less seen is given up. Written without branches, for which one it is cannot be foreseen.
    #[inline(always)]
    pub(super) fn look_up(&mut self, node: u32, class: usize) {
        self.class = class;
        let far = (node >> 4).wrapping_mul(0x9E37_79B1);
        for c in 0..CONTEXTS {
            let hash = (self.contexts[c] ^ far).wrapping_mul(0x85EB_CA6B);
            let hash = hash ^ hash >> 15;
            let first = c * (self.mask + 1) + ((hash ^ node & 15) as usize & self.mask);
            let second = first ^ 1;
            let check = ((hash >> 24) ^ node << 1) as u8 | 1;
            let (a, b) = (self.slots[first], self.slots[second]);
            let is_second = a.check != check && (b.check == check || b.seen < a.seen);
            let slot = if is_second { b } else { a };
            self.chosen[c] = if is_second { second } else { first };
            let known = slot.check == check;
            self.held[c] = Slot {
                one: slot.one,
                seen: if known { slot.seen } else { 0 },
                check,
            };
        }
    }

    /// Probability that the decision looked up is `true`: in units of `2^-16`, in `1..2^16`.
    #[inline(always)]
    pub(super) fn predict(&mut self) -> u32 {
        let table = self.log_odds;
        let start = self.class * STRIDE;
        let experts = &self.weights[start + CONTEXTS * CONFIDENCES..start + STRIDE];
        let mut terms = [0.0; CONTEXTS];
        for c in 0..CONTEXTS {
            let slot = self.held[c];
            self.rows[c] = start + c * CONFIDENCES + usize::from(CONFIDENCE[usize::from(slot.seen)]);
            self.inputs[c] = if slot.seen == 0 {
                0.0
            } else {
                table[usize::from(slot.one >> 4)]
            };
            terms[c] = self.weights[self.rows[c]] * self.inputs[c];
        }
        // In pairs, so that few additions wait for each other.
        let [a, b, c, d, e, f] = terms;
        let by_experts = (experts[0] * self.experts[0] + experts[1] * self.experts[1])
            + (experts[2] * self.experts[2] + experts[3] * self.experts[3]);
        let sum = ((a + b) + (c + d)) + ((e + f) + (by_experts + CONSTANT * experts[EXPERTS]));
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
        for c in 0..CONTEXTS {
            let slot = &mut self.held[c];
            let one = if slot.seen == 0 { mixed } else { i32::from(slot.one) };
            let moved = one + (((target - one) * SHARES[usize::from(slot.seen)]) >> 15);
            slot.one = moved.clamp(16, 65520) as u16;
            slot.seen = (slot.seen + 1).min(MOST_SEEN);
            self.slots[self.chosen[c]] = *slot;
        }
    }
}
