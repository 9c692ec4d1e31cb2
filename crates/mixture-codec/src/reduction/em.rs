//! Expectation-maximisation of Gaussian mixtures over weighted points, or over weighted Gaussians.

use crate::Error;
use fewbits_densities::Component;
use fewbits_numerics::eigen::raised;
use fewbits_numerics::kernels::scalar::{ln, power_of_half};
use fewbits_numerics::kernels::{LANES, folded, vectorised};
use nalgebra::{SMatrix, SVector};

/// Number of points that are processed together, so that their data stay in the first-level cache.
const BLOCK: usize = 32;
/// If the shares of a point sum to less, they are computed again relative to the largest.
const TINY: f64 = 1e-250;

/// Points in blocks. The last block is filled up with points of weight zero.
pub(super) struct Points<const D: usize> {
    blocks: Vec<Block<D>>,
    /// Covariance of each point of each block, lower triangle; empty if all are zero.
    spreads: Vec<[[[f64; BLOCK]; D]; D]>,
}

struct Block<const D: usize> {
    columns: [[f64; BLOCK]; D],
    weights: [f64; BLOCK],
}

/// The element `j` of a chunk that may end earlier: then the last.
fn at<T>(chunk: &[T], j: usize) -> &T {
    &chunk[j.min(chunk.len() - 1)]
}

impl<const D: usize> Points<D> {
    /// Points with their weights.
    pub(super) fn new(points: &[(SVector<f64, D>, f64)]) -> Self {
        let blocks = points.chunks(BLOCK).map(|chunk| Block {
            columns: std::array::from_fn(|d| std::array::from_fn(|j| at(chunk, j).0[d])),
            weights: std::array::from_fn(|j| chunk.get(j).map_or(0.0, |point| point.1)),
        });
        Self {
            blocks: blocks.collect(),
            spreads: Vec::new(),
        }
    }

    /// The same with the covariance of each point.
    pub(super) fn with_spreads(self, spreads: &[SMatrix<f64, D, D>]) -> Self {
        let of = |chunk: &[SMatrix<f64, D, D>]| {
            let entry = |a: usize, b: usize| std::array::from_fn(|j| at(chunk, j)[(a, b)]);
            std::array::from_fn(|a| std::array::from_fn(|b| entry(a, b)))
        };
        Self {
            spreads: spreads.chunks(BLOCK).map(of).collect(),
            ..self
        }
    }
}

/// Lower limits of the components.
pub(super) struct Limits<const D: usize> {
    /// The eigenvalues of covariances, each in units of its coordinate.
    pub(super) variances: SVector<f64, D>,
    /// A component of no more than this weight is dropped.
    pub(super) weight: f64,
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
    fn add(&mut self, shares: &[f64; BLOCK], gaps: &[[f64; BLOCK]; D], spread: Option<&[[[f64; BLOCK]; D]; D]>) {
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
        let Some(spread) = spread else { return };
        for a in 0..D {
            for b in 0..=a {
                for (i, share) in shares.iter().enumerate() {
                    self.second[a][b][i % LANES] += share * spread[a][b][i];
                }
            }
        }
    }

    /// Weight, mean and covariance from the sums about `mean`, with the lower limit of the eigenvalues.
    fn moments(&self, mean: &SVector<f64, D>, limits: &Limits<D>) -> Result<Component<D>, Error> {
        let weight = folded(self.share);
        let shift = SVector::<f64, D>::from_fn(|d, _| folded(self.first[d]) / weight);
        let mut covariance = SMatrix::<f64, D, D>::zeros();
        for a in 0..D {
            for b in 0..=a {
                let entry = folded(self.second[a][b]) / weight - shift[a] * shift[b];
                covariance[(a, b)] = entry;
                covariance[(b, a)] = entry;
            }
        }
        Component::new(weight, mean + shift, raised(covariance, &limits.variances))
    }
}

/// One step. Each point is divided among the components in proportion to weight times the exponential of the expected log density; each
/// component takes the moments of its shares. Returns the mean of the logarithms of the sums before the step (nats, up to a constant) if
/// it is `wanted`, otherwise zero.
///
/// ```text
/// r_pk           = w_k N(y_p; m_k, S_k) exp(-tr(S_k^-1 C_p) / 2) / sum_j ...      point p with covariance C_p
/// w_k, m_k, S_k  = moments of the points under v_p r_pk, C_p included
/// ```
///
/// # Errors
/// If the covariance of a component is singular in spite of the limits.
pub(super) fn step<const D: usize>(
    points: &Points<D>,
    parts: &mut Vec<Component<D>>,
    limits: &Limits<D>,
    wanted: bool,
) -> Result<f64, Error> {
    let heights: Vec<f64> = parts.iter().map(height).collect();
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sums: Vec<Sums<D>> = parts.iter().map(|_| Sums::ZERO).collect();
    let mut gaps = vec![[[0.0; BLOCK]; D]; parts.len()];
    let mut shares = vec![[0.0; BLOCK]; parts.len()];
    let mut mean_log = 0.0;
    vectorised(
        #[inline(always)]
        || {
            for (k, Block { columns, weights }) in points.blocks.iter().enumerate() {
                let spread = points.spreads.get(k);
                let (mut total, mut below) = ([0.0; BLOCK], [0.0; BLOCK]);
                for (((part, height), gaps), shares) in parts.iter().zip(&heights).zip(&mut gaps).zip(&mut shares) {
                    exponents(part, top - height, columns, spread, gaps, shares);
                    for j in 0..BLOCK {
                        shares[j] = power_of_half(shares[j]);
                    }
                    for j in 0..BLOCK {
                        total[j] += shares[j];
                    }
                }
                // Far from all components the densities underflow. Such points are computed relative to their own largest term.
                if total.iter().any(|t| *t < TINY) {
                    below = far_shares(parts, &heights, columns, spread, &mut gaps, &mut shares, &mut total);
                }
                if wanted {
                    for j in 0..BLOCK {
                        mean_log += weights[j] * (ln(total[j]) + (top - below[j]) * std::f64::consts::LN_2);
                    }
                }
                let mut scale = [0.0; BLOCK];
                for j in 0..BLOCK {
                    scale[j] = weights[j] / total[j];
                }
                for ((sums, gaps), shares) in sums.iter_mut().zip(&gaps).zip(&mut shares) {
                    for j in 0..BLOCK {
                        shares[j] *= scale[j];
                    }
                    sums.add(shares, gaps, spread);
                }
            }
        },
    );
    let mut next = Vec::with_capacity(parts.len());
    for (part, sums) in parts.iter().zip(&sums) {
        if folded(sums.share) > limits.weight {
            next.push(sums.moments(part.mean(), limits)?);
        }
    }
    *parts = next;
    Ok(mean_log)
}

/// Writes the differences from a component's mean, and `below - log2` of the component's density times its weight, unnormalised.
#[inline(always)]
fn exponents<const D: usize>(
    part: &Component<D>,
    below: f64,
    columns: &[[f64; BLOCK]; D],
    spread: Option<&[[[f64; BLOCK]; D]; D]>,
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
    let Some(spread) = spread else { return };
    // The trace of precision times covariance; the off-diagonal entries count twice.
    let precision = whitener.transpose() * whitener;
    for a in 0..D {
        for b in 0..=a {
            let entry = if a == b {
                precision[(a, b)]
            } else {
                2.0 * precision[(a, b)]
            };
            for j in 0..BLOCK {
                out[j] += entry * spread[a][b][j];
            }
        }
    }
}

/// The shares in a block with points far from every component: relative to the largest share of each point. Returns how far below the
/// highest peak that share is, as a power of one half.
#[cold]
#[inline(never)]
fn far_shares<const D: usize>(
    parts: &[Component<D>],
    heights: &[f64],
    columns: &[[f64; BLOCK]; D],
    spread: Option<&[[[f64; BLOCK]; D]; D]>,
    gaps: &mut [[[f64; BLOCK]; D]],
    shares: &mut [[f64; BLOCK]],
    total: &mut [f64; BLOCK],
) -> [f64; BLOCK] {
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for (((part, height), gaps), shares) in parts.iter().zip(heights).zip(gaps).zip(shares.iter_mut()) {
        exponents(part, top - height, columns, spread, gaps, shares);
    }
    *total = [0.0; BLOCK];
    std::array::from_fn(|j| {
        let least = shares.iter().map(|s| s[j]).fold(f64::INFINITY, f64::min);
        for share in shares.iter_mut() {
            share[j] = power_of_half(share[j] - least);
            total[j] += share[j];
        }
        least
    })
}
