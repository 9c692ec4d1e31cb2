//! The probability of one decision: counts in contexts and laws of experts, mixed in the logistic domain.
//!
//! ```text
//! log odds = sum_i w_i s_i          s_i: log odds that context or expert i gives, of a context times its confidence; w_i: by class of decision
//! w_i <- w_i + rate (bit - p) s_i   the gradient of the code length
//! ```
//!
//! All inputs of a decision are in one array, so that vector instructions process them together.

use crate::lanes::{Lanes, bits, greater, lesser, log2};
use crate::priors::MIXER_WEIGHTS;
use fewbits_node::elementary::squash;
use wide::bytemuck::cast;
use wide::u32x4;

/// Number of contexts in which outcomes are counted.
pub(crate) const CONTEXTS: usize = 4;
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

/// Contexts, experts' inputs and weights.
#[derive(Debug, Clone)]
pub(crate) struct Mixer {
    /// Pairs of slots, context after context.
    slots: Vec<[Slot; 2]>,
    /// Number of pairs per context.
    pairs: u32,
    /// Hashes of the contexts of this row.
    pub(crate) contexts: [u32; CONTEXTS],
    /// Probability of `true` in each context, and the odds of the experts, which the caller sets before each decision.
    yes: Lanes,
    odds: Lanes,
    /// Of contexts and of experts.
    weights: Box<[[Lanes; 2]; CLASSES]>,
    decisions: [f32; CLASSES],
    class: usize,
    /// The slots of the present decision: their places, hash bits, and numbers of occurrences.
    places: [u32; CONTEXTS],
    checks: u32x4,
    seen: Lanes,
    inputs: [Lanes; 2],
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
            yes: Lanes::HALF,
            odds: Lanes::ONE,
            weights: Box::new(MIXER_WEIGHTS.map(|weights| weights.map(Lanes::new))),
            decisions: [0.0; CLASSES],
            class: 0,
            places: [0; CONTEXTS],
            checks: u32x4::ZERO,
            seen: Lanes::ZERO,
            inputs: [Lanes::ZERO; 2],
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
        // Each bucket has two slots. The check byte identifies the context; if neither matches, replace the slot with fewer
        // occurrences.
        let (a, b, checks) = (u32x4::new(first), u32x4::new(second), u32x4::new(checks));
        let byte = u32x4::splat(255);
        let fewer = ((b >> 8_u32) & byte).simd_lt((a >> 8_u32) & byte);
        let is_second = (b & byte).simd_eq(checks) | (!(a & byte).simd_eq(checks) & fewer);
        let slot = is_second.bitselect(b, a);
        let times = (slot & byte).simd_eq(checks) & ((slot >> 8_u32) & byte);
        self.seen = Lanes::from_i32x4(cast(times));
        self.yes = (Lanes::from_i32x4(cast(slot >> 16_u32)) + 0.5) * (1.0 / UNITS);
        self.places = (u32x4::new(places) | (is_second & u32x4::ONE)).to_array();
        self.checks = checks;
    }

    /// Sets the shares that the experts give to the two outcomes.
    #[inline(always)]
    pub(crate) fn set_experts(&mut self, yes: Lanes, no: Lanes) {
        self.odds = greater(yes, LEAST) / greater(no, LEAST);
    }

    /// Probability that the decision looked up is `true`: in units of `2^-16`, in `1..2^16`.
    #[inline(always)]
    pub(crate) fn predict(&mut self) -> u32 {
        let input = |odds: Lanes| greater(lesser(log2(odds), FARTHEST_INPUT), -FARTHEST_INPUT);
        // Few occurrences say little: the log odds of a rarely seen context are reduced.
        let confidence = self.seen / (self.seen + HALF_CONFIDENCE);
        self.inputs = [input(self.yes / (Lanes::ONE - self.yes)) * confidence, input(self.odds)];
        let [contexts, experts] = self.weights[self.class];
        // Summed in pairs, so that fewer additions depend on each other.
        let [a, b, c, d] = (contexts * self.inputs[0] + experts * self.inputs[1]).to_array();
        let sum = (a + b) + (c + d);
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
        for (weights, inputs) in self.weights[self.class].iter_mut().zip(self.inputs) {
            *weights += inputs * change;
        }
        // A new context starts from the mixed probability.
        let mixed = self.p.clamp(LEAST_FIRST / UNITS, 1.0 - LEAST_FIRST / UNITS);
        let one = self.seen.simd_eq(Lanes::ZERO).bitselect(Lanes::splat(mixed), self.yes);
        // The mean of the outcomes, in which the first estimate counts as half an outcome.
        let moved = (one + (Lanes::splat(target) - one) / (self.seen + 1.5)) * UNITS;
        let moved = greater(lesser(moved, UNITS - LEAST_UNITS), LEAST_UNITS);
        let times = lesser(self.seen + 1.0, MOST_SEEN);
        // Probability, occurrences and hash bits in one word.
        let times = (bits(times + WHOLE) & u32x4::splat(255)) << 8_u32;
        let slots = (bits(moved + WHOLE) << 16_u32 | times | self.checks).to_array();
        for (place, slot) in self.places.into_iter().zip(slots) {
            self.slots[(place >> 1) as usize][(place & 1) as usize] = slot;
        }
    }
}
