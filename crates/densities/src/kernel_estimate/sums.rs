//! Sums over standard normal kernels in vector registers. Each kernel of a symmetric kernel matrix is computed once.

use fewbits_numerics::kernels::scalar::power_of_half;
use fewbits_numerics::kernels::{LANES, folded, vectorised};

/// Number of centres in a run; pairs within a run are evaluated one by one.
pub(super) const RUN: usize = 16;
/// `log2(e)/2`: converts squared distances to exponents of two.
const HALF_LOG2_E: f64 = 0.5 * std::f64::consts::LOG2_E;
/// Sums of kernels below this (`2^-900`) are computed again relative to the nearest centre.
pub(super) const TINY: f64 = 1.183_053_447e-271;
/// `|z - z_j|^2 log2(e)/2` of centre `j`.
#[inline(always)]
fn exponent<const D: usize>(white: &[&[f64]; D], z: &[f64; D], j: usize) -> f64 {
    let mut square = 0.0;
    for d in 0..D {
        let gap = white[d][j] - z[d];
        square += gap * gap;
    }
    square * HALF_LOG2_E
}

/// `count` centres from index `from` on. A slice of known length, so that bounds are checked once.
#[inline(always)]
pub(super) fn chunk_of<'a, const D: usize>(white: &[&'a [f64]; D], from: usize, count: usize) -> [&'a [f64]; D] {
    std::array::from_fn(|d| &white[d][from..from + count])
}

/// `sum_j w_j 2^-(s_j - offset)` of each point over all centres. An exponent `s_j` below the offset is replaced by the offset.
#[inline(always)]
fn kernel_sums<const D: usize, const P: usize>(
    white: &[&[f64]; D],
    weights: &[f64],
    points: &[[f64; D]; P],
    offset: f64,
) -> [f64; P] {
    // Several partial sums per point, so that additions do not wait for each other.
    let mut lane = [[0.0; LANES]; P];
    let whole = weights.len() / LANES * LANES;
    for from in (0..whole).step_by(LANES) {
        let (chunk, w) = (chunk_of(white, from, LANES), &weights[from..from + LANES]);
        for p in 0..P {
            for j in 0..LANES {
                let beyond = exponent(&chunk, &points[p], j) - offset;
                lane[p][j] += w[j] * power_of_half(if beyond > 0.0 { beyond } else { 0.0 });
            }
        }
    }
    let (chunk, w) = (chunk_of(white, whole, weights.len() - whole), &weights[whole..]);
    for p in 0..P {
        for (j, w) in w.iter().enumerate() {
            lane[p][j] += w * power_of_half((exponent(&chunk, &points[p], j) - offset).max(0.0));
        }
    }
    lane.map(folded)
}

/// `ln sum_j w_j exp(-|z - z_j|^2/2)` of each point, accurate in the tails: a tiny sum is computed again relative to the nearest centre.
#[inline(always)]
pub(super) fn log_kernel_sums<const D: usize, const P: usize>(
    white: &[&[f64]; D],
    weights: &[f64],
    points: &[[f64; D]; P],
) -> [f64; P] {
    let sums = kernel_sums(white, weights, points, 0.0);
    std::array::from_fn(|p| {
        if sums[p] > TINY {
            sums[p].ln()
        } else {
            log_far_sum(white, weights, &points[p])
        }
    })
}

#[cold]
#[inline(never)]
pub(super) fn log_far_sum<const D: usize>(white: &[&[f64]; D], weights: &[f64], z: &[f64; D]) -> f64 {
    // Centres of weight zero may be nearer but add nothing.
    let nearest = (0..weights.len())
        .filter(|i| weights[*i] > 0.0)
        .map(|i| exponent(white, z, i))
        .fold(f64::INFINITY, f64::min);
    if nearest == f64::INFINITY {
        return f64::NEG_INFINITY;
    }
    // The nearest centre then adds its whole weight, so the sum does not underflow.
    let [sum] = kernel_sums(white, weights, &[*z], nearest);
    sum.ln() - nearest / std::f64::consts::LOG2_E
}

/// Number of centres in a block of [`add_cross_sums`].
const BLOCK: usize = 32;

/// Kernels `k_ij = exp(-|z_i - z_j|^2/2)` between two runs of centres, `(white, weights, sums)` each: adds `sum_j w_j k_ij` to the
/// first sums and `sum_i w_i k_ij` to the second.
pub fn add_cross_sums<const D: usize>(
    (white_i, weights_i, left): (&[&[f64]; D], &[f64], &mut [f64]),
    (white_j, weights_j, right): (&[&[f64]; D], &[f64], &mut [f64]),
) {
    vectorised(
        #[inline(always)]
        || {
            let point = |i: usize| std::array::from_fn(|d| white_i[d][i]);
            let (pairs, odd) = weights_i.as_chunks::<2>();
            for (k, weights) in pairs.iter().enumerate() {
                let (i, j) = (2 * k, 2 * k + 1);
                let sums = cross_sums(white_j, weights_j, &[point(i), point(j)], weights, right);
                left[i] += sums[0];
                left[j] += sums[1];
            }
            if let [weight] = odd {
                let i = weights_i.len() - 1;
                left[i] += cross_sums(white_j, weights_j, &[point(i)], &[*weight], right)[0];
            }
        },
    );
}

/// Returns `sum_j w_j k_j` of each point, and adds the points' weighted kernels to `sums`: each kernel is used for both sums.
#[inline(always)]
fn cross_sums<const D: usize, const P: usize>(
    white: &[&[f64]; D],
    weights: &[f64],
    points: &[[f64; D]; P],
    own: &[f64; P],
    sums: &mut [f64],
) -> [f64; P] {
    let mut lane = [[0.0; LANES]; P];
    let columns = white.map(|c| c[..weights.len()].as_chunks::<BLOCK>());
    let (whole, rest) = weights.as_chunks::<BLOCK>();
    let (sums, sums_of_rest) = sums[..weights.len()].as_chunks_mut::<BLOCK>();
    for (k, (weights, sums)) in whole.iter().zip(sums).enumerate() {
        let chunk = std::array::from_fn(|d| &columns[d].0[k]);
        cross_block(&chunk, weights, points, own, sums, &mut lane);
    }
    if rest.len() > LANES {
        // The block is filled up with centres of weight zero.
        let padded = columns.map(|c| padded(c.1));
        let mut sums = [0.0; BLOCK];
        cross_block(&padded.each_ref(), &self::padded(rest), points, own, &mut sums, &mut lane);
        sums_of_rest.iter_mut().zip(&sums).for_each(|(to, sum)| *to += sum);
    } else {
        let rests = columns.map(|c| c.1);
        for p in 0..P {
            for (j, weight) in rest.iter().enumerate() {
                let kernel = power_of_half(exponent(&rests, &points[p], j));
                sums_of_rest[j] += own[p] * kernel;
                lane[p][j] += weight * kernel;
            }
        }
    }
    lane.map(folded)
}

/// A short run, filled up with zeros to the length of a block.
#[inline(always)]
fn padded(values: &[f64]) -> [f64; BLOCK] {
    let mut block = [0.0; BLOCK];
    block[..values.len()].copy_from_slice(values);
    block
}

#[inline(always)]
fn cross_block<const D: usize, const P: usize>(
    white: &[&[f64; BLOCK]; D],
    weights: &[f64; BLOCK],
    points: &[[f64; D]; P],
    own: &[f64; P],
    sums: &mut [f64; BLOCK],
    lane: &mut [[f64; LANES]; P],
) {
    for p in 0..P {
        let mut kernels = [0.0; BLOCK];
        for j in 0..BLOCK {
            let mut square = 0.0;
            for d in 0..D {
                let gap = white[d][j] - points[p][d];
                square += gap * gap;
            }
            kernels[j] = power_of_half(square * HALF_LOG2_E);
        }
        // Kernels first, sums second: each loop over the block runs in vector registers.
        for j in 0..BLOCK {
            sums[j] += own[p] * kernels[j];
        }
        for c in 0..BLOCK / LANES {
            for j in 0..LANES {
                lane[p][j] += kernels[c * LANES + j] * weights[c * LANES + j];
            }
        }
    }
}
