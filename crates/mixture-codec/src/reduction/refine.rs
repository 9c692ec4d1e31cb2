//! Expectation-maximisation that fits a mixture to a kernel estimate, with a lower limit of the covariances.

use crate::Error;
use crate::divergence::plug_in::Cubature;
use fewbits_densities::{Component, KernelEstimate, Mixture};
use fewbits_numerics::eigen::raised;
use fewbits_numerics::kernels::scalar::power_of_half;
use fewbits_numerics::kernels::{LANES, folded, vectorised};
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};

/// Improves a mixture as an approximation of a kernel estimate by `iterations` steps of expectation-maximisation. The data are the
/// cubature points of every kernel. Each step lowers the KL between the distribution of these points and the mixture.
///
/// No eigenvalue of a component's covariance falls below one, in coordinates in which the kernel's covariance is the identity.
/// Without this limit components could shrink to single cubature points. Components that lose all weight are dropped.
///
/// ```text
/// points y_p, v_p        = centres + kernel offsets, weights times shares     whitened: kernel = I
/// repeat: r_pk           = w_k N(y_p; m_k, S_k) / sum_j w_j N(y_p; m_j, S_j)
///         w_k, m_k, S_k  = moments of the points under v_p r_pk
///         S_k            = S_k with eigenvalues raised to 1
/// ```
///
/// # Errors
/// Does not occur for a valid estimate and mixture.
pub fn refine<const D: usize>(
    estimate: &KernelEstimate<D>,
    mixture: &Mixture<D>,
    iterations: usize,
    rule: Cubature,
) -> Result<Mixture<D>, Error> {
    let points = Points::new(estimate, rule);
    let origin = estimate.particles().mean();
    let white = estimate.kernel_factor();
    // In coordinates in which the kernel's covariance is the identity.
    let mut parts: Vec<Component<D>> = mixture
        .components()
        .iter()
        .filter(|c| c.weight() > 0.0)
        .map(|c| {
            let mean = white.whitener * (c.mean() - origin);
            let covariance = white.whitener * c.covariance() * white.whitener.transpose();
            Component::new(c.weight(), mean, symmetrised(&covariance))
        })
        .collect::<Result<_, _>>()?;
    for _ in 0..iterations {
        step(&points, &mut parts)?;
    }
    let back = parts.iter().map(|p| {
        let covariance = white.lower * p.covariance() * white.lower.transpose();
        Component::new(p.weight(), white.lower * p.mean() + origin, symmetrised(&covariance))
    });
    Mixture::new(back.collect::<Result<_, _>>()?)
}

/// Number of points that are processed together, so that their data stay in the first-level cache.
const BLOCK: usize = 32;
/// If the shares of a point sum to less, they are computed again relative to the largest.
const TINY: f64 = 1e-250;

/// The cubature points of all kernels in whitened coordinates, in blocks. The last block is filled up with points of weight
/// zero.
struct Points<const D: usize> {
    blocks: Vec<([[f64; BLOCK]; D], [f64; BLOCK])>,
}

impl<const D: usize> Points<D> {
    fn new(estimate: &KernelEstimate<D>, rule: Cubature) -> Self {
        let weights = estimate.particles().weights();
        let kept: Vec<usize> = (0..weights.len()).filter(|i| weights[*i] > 0.0).collect();
        let white = estimate.whitened_centres();
        let offsets = rule.points::<D>();
        let all: Vec<(SVector<f64, D>, f64)> = offsets
            .iter()
            .flat_map(|(z, share)| {
                kept.iter()
                    .map(move |i| (SVector::from_fn(|d, _| white[d][*i] + z[d]), weights[*i] * share))
            })
            .collect();
        let blocks = all.chunks(BLOCK).map(|chunk| {
            let at = |j: usize| chunk[j.min(chunk.len() - 1)].0;
            let columns = std::array::from_fn(|d| std::array::from_fn(|j| at(j)[d]));
            (columns, std::array::from_fn(|j| chunk.get(j).map_or(0.0, |point| point.1)))
        });
        Self {
            blocks: blocks.collect(),
        }
    }
}

/// `log2(w / sqrt(det S))`, the logarithm of a component's peak up to a constant.
fn height<const D: usize>(part: &Component<D>) -> f64 {
    (part.weight().ln() - part.factor().half_log_det) * std::f64::consts::LOG2_E
}

/// Sums over a component's shares of the points, about its mean before the step: total, first and second moments.
struct Sums<const D: usize> {
    share: [f64; LANES],
    first: [[f64; LANES]; D],
    second: [[[f64; LANES]; D]; D],
}

impl<const D: usize> Sums<D> {
    const ZERO: Self = Self {
        share: [0.0; LANES],
        first: [[0.0; LANES]; D],
        second: [[[0.0; LANES]; D]; D],
    };

    #[inline(always)]
    fn add(&mut self, shares: &[f64; BLOCK], gaps: &[[f64; BLOCK]; D]) {
        for c in 0..BLOCK / LANES {
            for j in 0..LANES {
                let i = c * LANES + j;
                self.share[j] += shares[i];
                for a in 0..D {
                    let weighted = shares[i] * gaps[a][i];
                    self.first[a][j] += weighted;
                    for b in 0..=a {
                        self.second[a][b][j] += weighted * gaps[b][i];
                    }
                }
            }
        }
    }
}

/// One step of expectation-maximisation.
fn step<const D: usize>(points: &Points<D>, parts: &mut Vec<Component<D>>) -> Result<(), Error> {
    let heights: Vec<f64> = parts.iter().map(height).collect();
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sums: Vec<Sums<D>> = parts.iter().map(|_| Sums::ZERO).collect();
    let mut gaps = vec![[[0.0; BLOCK]; D]; parts.len()];
    let mut shares = vec![[0.0; BLOCK]; parts.len()];
    vectorised(
        #[inline(always)]
        || {
            for (columns, weights) in &points.blocks {
                let mut total = [0.0; BLOCK];
                for (((part, height), gaps), shares) in parts.iter().zip(&heights).zip(&mut gaps).zip(&mut shares) {
                    exponents(part, top - height, columns, gaps, shares);
                    for j in 0..BLOCK {
                        shares[j] = power_of_half(shares[j]);
                    }
                    for j in 0..BLOCK {
                        total[j] += shares[j];
                    }
                }
                // Far from all components the densities underflow. Such points are computed relative to their own largest term.
                if total.iter().any(|t| *t < TINY) {
                    far_shares(parts, &heights, columns, &mut gaps, &mut shares, &mut total);
                }
                let mut scale = [0.0; BLOCK];
                for j in 0..BLOCK {
                    scale[j] = weights[j] / total[j];
                }
                for ((sums, gaps), shares) in sums.iter_mut().zip(&gaps).zip(&mut shares) {
                    for j in 0..BLOCK {
                        shares[j] *= scale[j];
                    }
                    sums.add(shares, gaps);
                }
            }
        },
    );
    // A component without weight is dropped.
    let mut next = Vec::with_capacity(parts.len());
    for (part, sums) in parts.iter().zip(&sums) {
        if folded(sums.share) > f64::MIN_POSITIVE {
            next.push(moments(part, sums)?);
        }
    }
    *parts = next;
    Ok(())
}

/// Writes the differences from a component's mean, and `below - log2` of the component's density times its weight, unnormalised.
#[inline(always)]
fn exponents<const D: usize>(
    part: &Component<D>,
    below: f64,
    columns: &[[f64; BLOCK]; D],
    gaps: &mut [[f64; BLOCK]; D],
    out: &mut [f64; BLOCK],
) {
    // With this factor `z' z` is the exponent of the Gaussian as a power of one half.
    let scale = (0.5 * std::f64::consts::LOG2_E).sqrt();
    let whitener = part.factor().whitener * scale;
    for d in 0..D {
        for j in 0..BLOCK {
            gaps[d][j] = columns[d][j] - part.mean()[d];
        }
    }
    *out = [below; BLOCK];
    for a in 0..D {
        for j in 0..BLOCK {
            let mut z = 0.0;
            for b in 0..=a {
                z += whitener[(a, b)] * gaps[b][j];
            }
            out[j] += z * z;
        }
    }
}

/// The shares in a block with points far from every component: relative to the largest share of each point.
#[cold]
#[inline(never)]
fn far_shares<const D: usize>(
    parts: &[Component<D>],
    heights: &[f64],
    columns: &[[f64; BLOCK]; D],
    gaps: &mut [[[f64; BLOCK]; D]],
    shares: &mut [[f64; BLOCK]],
    total: &mut [f64; BLOCK],
) {
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for (((part, height), gaps), shares) in parts.iter().zip(heights).zip(gaps).zip(shares.iter_mut()) {
        exponents(part, top - height, columns, gaps, shares);
    }
    *total = [0.0; BLOCK];
    for j in 0..BLOCK {
        let least = shares.iter().map(|s| s[j]).fold(f64::INFINITY, f64::min);
        for share in shares.iter_mut() {
            share[j] = power_of_half(share[j] - least);
            total[j] += share[j];
        }
    }
}

/// Weight, mean and covariance from the sums, with the lower limit of the eigenvalues.
fn moments<const D: usize>(part: &Component<D>, sums: &Sums<D>) -> Result<Component<D>, Error> {
    let weight = folded(sums.share);
    let shift = SVector::<f64, D>::from_fn(|d, _| folded(sums.first[d]) / weight);
    let mut covariance = SMatrix::<f64, D, D>::zeros();
    for a in 0..D {
        for b in 0..=a {
            let entry = folded(sums.second[a][b]) / weight - shift[a] * shift[b];
            covariance[(a, b)] = entry;
            covariance[(b, a)] = entry;
        }
    }
    let covariance = raised(covariance, &SVector::repeat(1.0));
    Component::new(weight, part.mean() + shift, covariance)
}
