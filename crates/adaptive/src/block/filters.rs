//! The bank of filters of [`fewbits_node::adaptive::Bank`] for regular rows, with the tails at two edges for one exponential a filter.

use super::experts::{FLAT, Tails};
use super::priors::FILTER_WEIGHTS;
use fewbits_node::adaptive::{DECAYS, MODELS, SCALES, steady_gains};
use fewbits_node::elementary::{exp2, greater, power};
use std::sync::LazyLock;

/// Share of the weights that is spread evenly before each slot.
const SWITCHING: f32 = 0.005;
/// The least evidence of one slot, and the least weight: far above the smallest normal number.
const LEAST_EVIDENCE: f32 = 1e-12;
const LEAST_WEIGHT: f32 = 1e-18;

/// Widths of a cell, in doublings, of which the filters' laws know the ratio of the odds at its two edges. Wider cells count as these.
const WIDEST: usize = 47;

struct Gains {
    sharpness: [f32; MODELS],
    position: [f32; MODELS],
    velocity: [f32; MODELS],
    decay: [f32; MODELS],
    /// Odds at the upper edge of a cell of `2^k` over those at its lower edge.
    ratios: [[f32; MODELS]; WIDEST],
}

static GAINS: LazyLock<Gains> = LazyLock::new(|| {
    let mut gains = Gains {
        sharpness: [0.0; MODELS],
        position: [0.0; MODELS],
        velocity: [0.0; MODELS],
        decay: [0.0; MODELS],
        ratios: [[0.0; MODELS]; WIDEST],
    };
    for m in 0..MODELS {
        let [sharpness, position, velocity] = steady_gains(m);
        gains.sharpness[m] = sharpness;
        gains.position[m] = position;
        gains.velocity[m] = velocity;
        gains.decay[m] = DECAYS[m / SCALES];
        for (k, ratios) in gains.ratios.iter_mut().enumerate() {
            let width = (1_u64 << k) as f32;
            ratios[m] = exp2((-gains.sharpness[m] * width).max(-FLAT));
        }
    }
    gains
});

/// The bank of filters, weighted by what they predicted.
#[derive(Debug, Clone)]
pub(super) struct Filters {
    position: [f32; MODELS],
    velocity: [f32; MODELS],
    weight: [f32; MODELS],
    /// What each filter says about the cell last asked for by [`cell`](Self::cell), times its weight.
    evidence: [f32; MODELS],
}

/// The sum in eight lanes, then of the lanes: an order that vectorises.
#[inline(always)]
fn sum(terms: &[f32; MODELS]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    for chunk in terms.chunks_exact(8) {
        for (lane, term) in lanes.iter_mut().zip(chunk) {
            *lane += term;
        }
    }
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
}

impl Filters {
    pub(super) fn new() -> Self {
        Self {
            position: [0.0; MODELS],
            velocity: [0.0; MODELS],
            weight: FILTER_WEIGHTS,
            evidence: [0.0; MODELS],
        }
    }

    /// The time update; returns the mean.
    #[inline(always)]
    pub(super) fn predict(&mut self) -> f32 {
        let decay = &GAINS.decay;
        let mut terms = [0.0; MODELS];
        for m in 0..MODELS {
            self.weight[m] = self.weight[m] * (1.0 - SWITCHING) + SWITCHING / MODELS as f32;
            self.velocity[m] *= decay[m];
            self.position[m] += self.velocity[m];
            terms[m] = self.weight[m] * self.position[m];
        }
        sum(&terms)
    }

    #[inline(always)]
    pub(super) fn tails(&self, edge: f32) -> Tails {
        let sharpness = &GAINS.sharpness;
        let (mut below, mut above) = ([0.0; MODELS], [0.0; MODELS]);
        for m in 0..MODELS {
            let e = power(((self.position[m] - edge) * sharpness[m]).clamp(-FLAT, FLAT));
            let share = self.weight[m] / (1.0 + e);
            below[m] = share;
            above[m] = e * share;
        }
        Tails {
            below: sum(&below),
            above: sum(&above),
        }
    }

    /// The tails at the lower and the upper edge of a cell of `2^k`: one exponential a filter for both.
    #[inline(always)]
    pub(super) fn cell(&mut self, edge: f32, k: u32) -> [Tails; 2] {
        let gains = &*GAINS;
        let ratios = &gains.ratios[(k as usize).min(WIDEST - 1)];
        let mut parts = [[0.0; MODELS]; 4];
        for m in 0..MODELS {
            let low = power(((self.position[m] - edge) * gains.sharpness[m]).clamp(-FLAT, FLAT));
            let high = low * ratios[m];
            let share = self.weight[m] / ((1.0 + low) * (1.0 + high));
            let (below_low, below_high) = (share * (1.0 + high), share * (1.0 + low));
            parts[0][m] = below_low;
            parts[1][m] = low * below_low;
            parts[2][m] = below_high;
            parts[3][m] = high * below_high;
            self.evidence[m] = share * (low - high);
        }
        let [below_low, above_low, below_high, above_high] = parts.each_ref().map(sum);
        [
            Tails {
                below: below_low,
                above: above_low,
            },
            Tails {
                below: below_high,
                above: above_high,
            },
        ]
    }

    /// The measurement update with an index `step` from the last one, which becomes the origin. `inside`: it is the cell of width one that
    /// [`cell`](Self::cell) was asked for.
    #[inline(always)]
    pub(super) fn update(&mut self, step: f32, inside: bool) {
        let gains = &*GAINS;
        if !inside {
            self.cell(step - 0.5, 0);
        }
        for m in 0..MODELS {
            let residual = step - self.position[m];
            self.evidence[m] = greater(self.evidence[m], LEAST_EVIDENCE * self.weight[m]);
            self.position[m] += gains.position[m] * residual - step;
            self.velocity[m] += gains.velocity[m] * residual;
        }
        let inverse = 1.0 / sum(&self.evidence);
        for m in 0..MODELS {
            self.weight[m] = greater(self.evidence[m] * inverse, LEAST_WEIGHT);
        }
    }

    #[cfg(test)]
    pub(super) fn total(&self) -> f32 {
        sum(&self.weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_tails_sum_to_their_weights() {
        let mut filters = Filters::new();
        for i in 0..2000_i16 {
            filters.predict();
            let step = f32::from(i % 7 - 3) * if i % 100 == 0 { 1e9 } else { 1.0 };
            for edge in [-1e6, -2.5, 0.5, 3.5, 1e6] {
                let tails = filters.tails(edge);
                assert!((tails.below + tails.above - filters.total()).abs() < 1e-4, "{i}");
            }
            filters.update(step, false);
            assert!((filters.total() - 1.0).abs() < 1e-4 && filters.position.iter().all(|x| x.is_finite()));
        }
    }
}
