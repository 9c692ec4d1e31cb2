//! The probability of one decision: counts in contexts and laws of experts, mixed in the logistic domain.
//!
//! ```text
//! log odds = sum_i w_i s_i          s_i: log odds that context or expert i gives, of a context times its confidence; w_i: by class of decision
//! w_i <- w_i + rate (bit - p) s_i   the gradient of the code length
//! ```
//!
//! All inputs of a decision are in one array, so that vector instructions process them together.

use crate::priors::MIXER_WEIGHTS;
use fewbits_node::elementary::{greater, lesser, log2, squash};

/// Number of contexts in which outcomes are counted.
pub(crate) const CONTEXTS: usize = 4;
/// Number of experts. Their inputs follow those of the contexts.
pub(crate) const EXPERTS: usize = 4;
/// Number of inputs: they fill a vector register.
pub(crate) const INPUTS: usize = CONTEXTS + EXPERTS;
/// Number of classes of decisions, each with its own weights: zero, sign, three magnitudes, further ones, inside an interval, low bits.
pub(crate) const CLASSES: usize = 8;
/// Largest size of the log odds of a decision and of an input, in bits.
const FARTHEST: f32 = 15.0;
const FARTHEST_INPUT: f32 = 12.0;
/// Smallest share of an expert's probability.
const LEAST: f32 = 1e-9;
/// Learning rate of the weights in the long run, its factor at the start, and the decisions over which it falls.
const RATE: f32 = 0.0015;
const FIRST_RATES: f32 = 6.0;
const RATE_FALLS: f32 = 32.0;
/// Number of occurrences after which a context gives old ones less weight.
const MOST_SEEN: f32 = 60.0;
/// Number of occurrences at which a context has half of its final confidence.
const HALF_CONFIDENCE: f32 = 1.3;
/// Reciprocal of the unit of stored probabilities.
const UNITS: f32 = 65536.0;
const LEAST_UNITS: f32 = 16.0;
/// Smallest distance from 0 and 1, in these units, of the probability that a new context starts from.
const LEAST_FIRST: f32 = 256.0;
/// Adding this to an `f32` below `2^23` puts its integer part into the lowest bits.
const WHOLE: f32 = 8_388_608.0;

/// Outcomes of a decision in one context: probability of `true` (high 16 bits), how often seen (8 bits), a few bits of the hash, never 0.
type Slot = u32;

fn seen(slot: Slot) -> u32 {
    slot >> 8 & 255
}

/// Contexts, experts' inputs and weights.
#[derive(Debug, Clone)]
pub(crate) struct Mixer {
    /// Pairs of slots, context after context.
    slots: Vec<[Slot; 2]>,
    /// Number of pairs per context.
    pairs: u32,
    /// Hashes of the contexts of this row.
    pub(crate) contexts: [u32; CONTEXTS],
    /// Shares of the two outcomes. The caller sets those of the experts before each decision.
    yes: [f32; INPUTS],
    no: [f32; INPUTS],
    weights: Box<[[f32; INPUTS]; CLASSES]>,
    decisions: [f32; CLASSES],
    class: usize,
    /// The slots of the present decision: their places, hash bits, and numbers of occurrences.
    places: [u32; CONTEXTS],
    checks: [u32; CONTEXTS],
    seen: [f32; CONTEXTS],
    inputs: [f32; INPUTS],
    p: f32,
}

impl Mixer {
    /// A mixer for a block of `rows` rows.
    pub(crate) fn new(rows: usize) -> Self {
        let pairs = rows.min(1 << 13).next_power_of_two().max(1 << 8);
        Self {
            slots: vec![[0; 2]; CONTEXTS * pairs],
            pairs: pairs as u32,
            contexts: [0; CONTEXTS],
            yes: [1.0; INPUTS],
            no: [1.0; INPUTS],
            weights: Box::new(MIXER_WEIGHTS),
            decisions: [0.0; CLASSES],
            class: 0,
            places: [0; CONTEXTS],
            checks: [0; CONTEXTS],
            seen: [0.0; CONTEXTS],
            inputs: [0.0; INPUTS],
            p: 0.5,
        }
    }

    /// Looks up the counts of all contexts for the decision `node` of a class. The caller can compute the experts' inputs while memory is
    /// read.
    ///
    /// Decisions of one context are adjacent, sixteen per cache line. A slot is one of a pair. If neither is of this
    /// context, the one with fewer occurrences is replaced. The code has no branches, because the processor would mispredict them.
    #[inline(always)]
    pub(crate) fn look_up(&mut self, node: u32, class: usize) {
        self.class = class;
        let far = (node >> 4).wrapping_mul(0x9E37_79B1);
        let (mut places, mut checks) = ([0; CONTEXTS], [0; CONTEXTS]);
        // All addresses first, then all loads: the loads overlap instead of waiting for each other.
        for c in 0..CONTEXTS {
            let hash = (self.contexts[c] ^ far).wrapping_mul(0x85EB_CA6B);
            let hash = hash ^ hash >> 15;
            let pair = (hash ^ node >> 1 & 7) & (self.pairs - 1);
            places[c] = 2 * (pair + c as u32 * self.pairs);
            checks[c] = ((hash >> 24) ^ node << 1) & 255 | 1;
        }
        let (mut first, mut second) = ([0; CONTEXTS], [0; CONTEXTS]);
        for c in 0..CONTEXTS {
            [first[c], second[c]] = self.slots[(places[c] >> 1) as usize];
        }
        for c in 0..CONTEXTS {
            let (a, b, check) = (first[c], second[c], checks[c]);
            // Each bucket has two slots. The check byte identifies the context; if neither matches, replace the slot with fewer
            // occurrences.
            let is_second = (b & 255 == check) | ((a & 255 != check) & (seen(b) < seen(a)));
            let slot = if is_second { b } else { a };
            places[c] |= u32::from(is_second);
            let times = if slot & 255 == check { seen(slot) } else { 0 };
            self.seen[c] = times as i32 as f32;
            self.yes[c] = ((slot >> 16) as i32 as f32 + 0.5) * (1.0 / UNITS);
            self.no[c] = 1.0 - self.yes[c];
        }
        (self.places, self.checks) = (places, checks);
    }

    /// Sets the shares that the experts give to the two outcomes.
    #[inline(always)]
    pub(crate) fn set_experts(&mut self, yes: [f32; EXPERTS], no: [f32; EXPERTS]) {
        for e in 0..EXPERTS {
            self.yes[CONTEXTS + e] = greater(yes[e], LEAST);
            self.no[CONTEXTS + e] = greater(no[e], LEAST);
        }
    }

    /// Probability that the decision looked up is `true`: in units of `2^-16`, in `1..2^16`.
    #[inline(always)]
    pub(crate) fn predict(&mut self) -> u32 {
        let mut inputs = [0.0; INPUTS];
        for i in 0..INPUTS {
            let odds = log2(self.yes[i] / self.no[i]);
            inputs[i] = greater(lesser(odds, FARTHEST_INPUT), -FARTHEST_INPUT);
        }
        // Few occurrences say little: the log odds of a rarely seen context are reduced.
        for c in 0..CONTEXTS {
            inputs[c] *= self.seen[c] / (self.seen[c] + HALF_CONFIDENCE);
        }
        let weights = &self.weights[self.class];
        let mut terms = [0.0; INPUTS];
        for i in 0..INPUTS {
            terms[i] = weights[i] * inputs[i];
        }
        self.inputs = inputs;
        // Summed in pairs, so that fewer additions depend on each other.
        let [a, b, c, d, e, f, g, h] = terms;
        let sum = ((a + e) + (b + f)) + ((c + g) + (d + h));
        self.p = squash(sum.clamp(-FARTHEST, FARTHEST));
        ((self.p * UNITS) as u32).clamp(1, 65535)
    }

    /// Updates counts and weights with the outcome of the decision.
    #[inline(always)]
    pub(crate) fn update(&mut self, bit: bool) {
        let decisions = &mut self.decisions[self.class];
        let rate = RATE * (1.0 + FIRST_RATES / (1.0 + *decisions * (1.0 / RATE_FALLS)));
        *decisions += 1.0;
        let target = f32::from(u8::from(bit));
        let change = rate * (target - self.p);
        let weights = &mut self.weights[self.class];
        for i in 0..INPUTS {
            weights[i] += change * self.inputs[i];
        }
        // A new context starts from the mixed probability.
        let mixed = self.p.clamp(LEAST_FIRST / UNITS, 1.0 - LEAST_FIRST / UNITS);
        let mut slots = [0; CONTEXTS];
        for c in 0..CONTEXTS {
            let seen = self.seen[c];
            let one = if seen == 0.0 { mixed } else { self.yes[c] };
            // The mean of the outcomes, in which the first estimate counts as half an outcome.
            let moved = (one + (target - one) / (seen + 1.5)) * UNITS;
            let moved = greater(lesser(moved, UNITS - LEAST_UNITS), LEAST_UNITS);
            let times = lesser(seen + 1.0, MOST_SEEN);
            // Probability, occurrences and hash bits in one word.
            slots[c] = (moved + WHOLE).to_bits() << 16 | ((times + WHOLE).to_bits() & 255) << 8 | self.checks[c];
        }
        for c in 0..CONTEXTS {
            let place = self.places[c] as usize;
            self.slots[place >> 1][place & 1] = slots[c];
        }
    }
}
