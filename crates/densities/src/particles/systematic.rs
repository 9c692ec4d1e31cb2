//! Systematic selection: indices in proportion to weights, by evenly spaced points of the cumulative weight.

use fewbits_numerics::kernels::{sum, vectorised};

/// Indices of `count` systematic draws from `weights`: index `i` occurs `count w_i / sum w` times, rounded up or down. Draw `j` is at
/// `(j + offset) / count` of the cumulative weight; `offset` is uniform in `[0, 1)` for random draws, or 1/2 for a deterministic selection.
/// If all weights are zero, every draw is index 0.
pub fn systematic(weights: &[f64], count: usize, offset: f64) -> Vec<usize> {
    let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(0);
    let (weights, mut chosen) = (weights.get(..=last).unwrap_or(&[]), vec![0; count]);
    let largest = weights.iter().copied().fold(0.0, f64::max);
    if largest > 0.0 {
        // Sums of very large or small weights would overflow or be subnormal.
        let scaled: Vec<f64> = weights.iter().map(|w| (w / largest).max(0.0)).collect();
        systematic_into(&scaled, sum(&scaled), offset, &mut chosen);
    }
    chosen.into_iter().map(|i| i as usize).collect()
}

/// Weights that [`systematic_into`] processes together.
const BLOCK: usize = 128;
/// Neighbours whose cumulative sums are computed together.
const GROUP: usize = 8;
/// Entries whose running maximum [`fill_up`] computes together.
const LANES: usize = 16;
/// `2^52`: added to a number below it, it leaves the nearest integer in the mantissa.
const INTEGERS: f64 = 4_503_599_627_370_496.0;
/// `1.5 * 2^52`: the same for numbers that may be below zero.
const ROUNDER: f64 = 1.5 * INTEGERS;
/// All bits set where the element that many places before is in the same group.
const SAME_GROUP: [[u64; BLOCK]; 3] = [same_group(1), same_group(2), same_group(4)];

const fn same_group(back: usize) -> [u64; BLOCK] {
    let mut mask = [0; BLOCK];
    let mut j = 0;
    while j < BLOCK {
        mask[j] = if j % GROUP >= back { u64::MAX } else { 0 };
        j += 1;
    }
    mask
}

/// The integer nearest to `x` in `0..=2^51`.
#[inline(always)]
fn integer(x: f64) -> u64 {
    (x + INTEGERS).to_bits().wrapping_sub(INTEGERS.to_bits())
}

/// Indices of systematic draws from weights of the sum `total`, which is a positive normal number and whose last weight is positive; one
/// for each entry of `chosen`, by the rule of [`systematic`].
///
/// There is no branch that depends on the weights. Index `i` gets the places from `round(places_per_weight * cumulative_{i-1} - offset + 1/2)`
/// up to the same expression with `cumulative_i`.
///
/// The weights are converted to integers of 51 bits first. Their cumulative sums are exact in any order, so they can be computed in
/// parallel, never decrease, and stay equal at a weight of zero. Each index is written at its first place; one without a
/// place is overwritten by the next. A running maximum then fills the places between.
pub fn systematic_into(weights: &[f64], total: f64, offset: f64, chosen: &mut [u32]) {
    let scale = 0.5 * INTEGERS / total;
    vectorised(
        #[inline(always)]
        || {
            let mut whole = 0;
            for weight in weights {
                whole += integer(*weight * scale);
            }
            let per_weight = chosen.len() as f64 / whole as f64;
            chosen.fill(0);
            let (mut carry, mut index, mut first) = (0, 0, 0_u32);
            let (mut sums, mut other, mut firsts) = ([0; GROUP + BLOCK], [0; GROUP + BLOCK], [0_u32; BLOCK]);
            for weights in weights.chunks(BLOCK) {
                for (sum, weight) in sums[GROUP..].iter_mut().zip(weights) {
                    *sum = integer(*weight * scale);
                }
                add_before::<1>(&sums, &mut other, &SAME_GROUP[0]);
                add_before::<2>(&other, &mut sums, &SAME_GROUP[1]);
                add_before::<4>(&sums, &mut other, &SAME_GROUP[2]);
                for (firsts, sums) in firsts.chunks_exact_mut(GROUP).zip(other[GROUP..].chunks_exact(GROUP)) {
                    for j in 0..GROUP {
                        let cumulative = f64::from_bits((carry + sums[j]) | INTEGERS.to_bits()) - INTEGERS;
                        firsts[j] = (cumulative * per_weight + (0.5 - offset) + ROUNDER).to_bits() as u32;
                    }
                    carry += sums[GROUP - 1];
                }
                for next in &firsts[..weights.len()] {
                    // The last indices may have their first place beyond the end.
                    if let Some(place) = chosen.get_mut(first as usize) {
                        *place = index;
                    }
                    (index, first) = (index + 1, *next);
                }
            }
            fill_up(chosen);
        },
    );
}

/// Replaces every entry by the largest up to its place.
#[inline(always)]
fn fill_up(entries: &mut [u32]) {
    let mut so_far = 0;
    let mut chunks = entries.chunks_exact_mut(LANES);
    for chunk in &mut chunks {
        let mut rising = [0; LANES];
        rising.copy_from_slice(chunk);
        rising = raised::<1>(rising);
        rising = raised::<2>(rising);
        rising = raised::<4>(rising);
        rising = raised::<8>(rising);
        for j in 0..LANES {
            chunk[j] = rising[j].max(so_far);
        }
        so_far = so_far.max(rising[LANES - 1]);
    }
    for entry in chunks.into_remainder() {
        so_far = so_far.max(*entry);
        *entry = so_far;
    }
}

/// The larger of each entry and the entry `BACK` places before.
#[inline(always)]
fn raised<const BACK: usize>(x: [u32; LANES]) -> [u32; LANES] {
    std::array::from_fn(
        #[inline(always)]
        |j| if j >= BACK { x[j].max(x[j - BACK]) } else { x[j] },
    )
}

/// Writes each sum with the one `BACK` places before, within its group, to `to`.
#[inline(always)]
fn add_before<const BACK: usize>(
    from: &[u64; GROUP + BLOCK],
    to: &mut [u64; GROUP + BLOCK],
    same_group: &[u64; BLOCK],
) {
    for j in 0..BLOCK {
        to[GROUP + j] = from[GROUP + j] + (from[GROUP + j - BACK] & same_group[j]);
    }
}
