//! Kernel density estimates: weighted particles under one common Gaussian kernel.

use crate::matrix::Factored;
use crate::{Bandwidth, Component, Error, Mixture, Particles};
use fewbits_core::Columns;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::kernels::{scalar, sum, vectorised};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A belief `sum_i w_i N(x; x_i, H)`: particles that have a density.
///
/// The centres are also kept in coordinates where the kernel is the standard normal, so that a kernel costs `D` differences and
/// one exponential.
///
/// ```
/// use fewbits_densities::{Bandwidth, KernelEstimate, Particles};
/// let sample = Particles::uniform([vec![-1.0, 0.0, 0.5, 2.0]])?;
/// let estimate = KernelEstimate::fit(sample, &Bandwidth::default())?;
/// let mut log_density = [0.0];
/// estimate.log_pdf_columns([&[0.2]], &mut log_density);
/// assert!(log_density[0] < 0.0);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>", into = "Stored<D>")]
pub struct KernelEstimate<const D: usize> {
    particles: Particles<D>,
    kernel: SMatrix<f64, D, D>,
    factor: Factored<D>,
    origin: SVector<f64, D>,
    white: [Vec<f64>; D],
}

impl<const D: usize> KernelEstimate<D> {
    /// Particles under a kernel of the given covariance.
    ///
    /// # Errors
    /// If the kernel is not symmetric positive definite.
    pub fn new(particles: Particles<D>, kernel: SMatrix<f64, D, D>) -> Result<Self, Error> {
        let factor = Factored::new("kernel", &kernel)?;
        let origin = particles.mean();
        let columns = particles.columns();
        let white = whitened(&factor, &origin, &columns, 0..particles.len());
        Ok(Self {
            kernel: (kernel + kernel.transpose()) * 0.5,
            particles,
            factor,
            origin,
            white,
        })
    }

    /// Particles under the kernel of a bandwidth rule.
    ///
    /// # Errors
    /// As [`Bandwidth::kernel`].
    pub fn fit(particles: Particles<D>, bandwidth: &Bandwidth) -> Result<Self, Error> {
        let kernel = bandwidth.kernel(&particles)?;
        Self::new(particles, kernel)
    }

    /// The particles.
    pub fn particles(&self) -> &Particles<D> {
        &self.particles
    }

    /// Covariance of the kernel.
    pub fn kernel(&self) -> &SMatrix<f64, D, D> {
        &self.kernel
    }

    /// Number of kernels, at least one.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Never true: an estimate has at least one kernel.
    pub fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    pub(crate) fn factor(&self) -> &Factored<D> {
        &self.factor
    }

    /// The centres in coordinates where the kernel is the standard normal, about the sample's mean.
    pub(crate) fn white(&self) -> &[Vec<f64>; D] {
        &self.white
    }

    /// Mean.
    pub fn mean(&self) -> SVector<f64, D> {
        self.particles.mean()
    }

    /// Covariance: the sample's plus the kernel's.
    pub fn covariance(&self) -> SMatrix<f64, D, D> {
        self.particles.covariance() + self.kernel
    }

    /// `ln p(x)`, never NaN for finite `x`.
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> f64 {
        let columns: [[f64; 1]; D] = std::array::from_fn(|d| [x[d]]);
        let mut out = [0.0];
        self.log_pdf_columns(columns.each_ref().map(<[f64; 1]>::as_slice), &mut out);
        out[0]
    }

    /// Writes `ln p` of every point of `columns` to `out`, in the log domain: exact in the tails. One kernel per particle and
    /// point.
    pub fn log_pdf_columns(&self, columns: Columns<'_, D>, out: &mut [f64]) {
        let points = whitened(&self.factor, &self.origin, &columns, 0..out.len());
        let weights = self.particles.weights();
        let offset = self.factor.half_log_det + D as f64 * LN_SQRT_2PI;
        let white = self.white.each_ref().map(Vec::as_slice);
        for (p, out) in out.iter_mut().enumerate() {
            let z: [f64; D] = std::array::from_fn(|d| points[d][p]);
            *out = log_kernel_sum(&white, weights, &z) - offset;
        }
    }

    /// `ln p` at every centre. Half the kernels of [`log_pdf_columns`](Self::log_pdf_columns): they are symmetric.
    pub fn log_pdf_at_centres(&self) -> Vec<f64> {
        let weights = self.particles.weights();
        let mut sums = weights.to_vec();
        for i in 0..self.len() {
            let z: [f64; D] = std::array::from_fn(|d| self.white[d][i]);
            let rest: [&[f64]; D] = self.white.each_ref().map(|c| &c[i + 1..]);
            let across = cross_sums(&rest, &weights[i + 1..], &z, weights[i], &mut sums[i + 1..]);
            sums[i] += across;
        }
        let offset = self.factor.half_log_det + D as f64 * LN_SQRT_2PI;
        sums.iter().map(|s| s.ln() - offset).collect()
    }

    /// The same density as a mixture, one component per particle of positive weight.
    ///
    /// # Errors
    /// Never for a valid estimate.
    pub fn to_mixture(&self) -> Result<Mixture<D>, Error> {
        let components = (0..self.len()).filter(|i| self.particles.weights()[*i] > 0.0).map(|i| {
            let centre = SVector::from_fn(|d, _| self.particles.columns()[d][i]);
            Component::new(self.particles.weights()[i], centre, self.kernel)
        });
        Mixture::new(components.collect::<Result<_, _>>()?)
    }

    /// `count` equally weighted draws: systematic selection of the centres, each moved by one draw of the kernel.
    ///
    /// # Errors
    /// If `count` is 0.
    pub fn sample_systematic<R: Rng + ?Sized>(&self, rng: &mut R, count: usize) -> Result<Particles<D>, Error> {
        at_least_one("count", count)?;
        let chosen = systematic(rng, self.particles.weights(), count);
        let mut chosen = chosen.into_iter();
        let columns = self.particles.columns();
        Particles::from_draws(count, || {
            let i = chosen.next().unwrap_or(0);
            let z = SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
            SVector::from_fn(|d, _| columns[d][i]) + self.factor.lower * z
        })
    }
}

/// Indices of `count` systematic draws from `weights`: index `i` comes up `count w_i` times, rounded up or down.
pub(crate) fn systematic<R: Rng + ?Sized>(rng: &mut R, weights: &[f64], count: usize) -> Vec<usize> {
    let offset: f64 = rng.random();
    let total: f64 = sum(weights);
    let mut i = 0;
    let mut cumulative = weights.first().copied().unwrap_or(0.0);
    (0..count)
        .map(|k| {
            let level = (k as f64 + offset) / count as f64 * total;
            while level >= cumulative && i + 1 < weights.len() {
                i += 1;
                cumulative += weights[i];
            }
            i
        })
        .collect()
}

/// Coordinates `L^-1 (x - origin)` of the columns' points in `range`.
pub(crate) fn whitened<const D: usize>(
    factor: &Factored<D>,
    origin: &SVector<f64, D>,
    columns: &Columns<'_, D>,
    range: std::ops::Range<usize>,
) -> [Vec<f64>; D] {
    std::array::from_fn(|i| {
        range
            .clone()
            .map(|k| {
                (0..=i)
                    .map(|j| factor.whitener[(i, j)] * (columns[j][k] - origin[j]))
                    .sum()
            })
            .collect()
    })
}

/// Centres per block: what a block needs stays in the first-level cache.
const BLOCK: usize = 256;
/// Lanes of the sums over kernels.
const LANES: usize = 8;

/// Writes `|z - z_j|^2 / 2` of a block of centres from `from` on.
#[inline(always)]
fn half_squares<const D: usize>(white: &[&[f64]; D], z: &[f64; D], from: usize, out: &mut [f64]) {
    out.fill(0.0);
    for d in 0..D {
        let zd = z[d];
        for (out, x) in out.iter_mut().zip(&white[d][from..]) {
            let gap = x - zd;
            *out += 0.5 * gap * gap;
        }
    }
}

/// Smallest of a block and the given.
#[inline(always)]
fn smallest(start: f64, values: &[f64]) -> f64 {
    let mut lane = [start; LANES];
    let chunks = values.chunks_exact(LANES);
    for (l, x) in lane.iter_mut().zip(chunks.remainder()) {
        *l = if *x < *l { *x } else { *l };
    }
    for chunk in chunks {
        for j in 0..LANES {
            lane[j] = if chunk[j] < lane[j] { chunk[j] } else { lane[j] };
        }
    }
    lane.iter().fold(start, |m, x| if *x < m { *x } else { m })
}

/// Adds `w_j k_j` to the lanes.
#[inline(always)]
fn add_products(lane: &mut [f64; LANES], weights: &[f64], kernels: &[f64]) {
    let (weights, kernels) = (weights.chunks_exact(LANES), kernels.chunks_exact(LANES));
    let rest = weights.remainder().iter().zip(kernels.remainder());
    lane.iter_mut().zip(rest).for_each(|(l, (w, k))| *l += w * k);
    for (w, k) in weights.zip(kernels) {
        for j in 0..LANES {
            lane[j] += w[j] * k[j];
        }
    }
}

/// Adds the lanes in a fixed order.
#[inline(always)]
fn folded(lane: &[f64; LANES]) -> f64 {
    ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]))
}

/// `ln sum_j w_j exp(-|z - z_j|^2/2)`, in the log domain: the nearest centre of a block is taken out before exponentials.
fn log_kernel_sum<const D: usize>(white: &[&[f64]; D], weights: &[f64], z: &[f64; D]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let mut buffer = [0.0; BLOCK];
            let mut nearest = f64::INFINITY;
            let mut total = 0.0;
            for (block, weights) in weights.chunks(BLOCK).enumerate() {
                let squares = &mut buffer[..weights.len()];
                half_squares(white, z, block * BLOCK, squares);
                let closest = smallest(f64::INFINITY, squares);
                if closest < nearest {
                    // Nothing was added yet, or what was is rescaled.
                    total *= (closest - nearest).exp();
                    nearest = closest;
                }
                if nearest == f64::INFINITY {
                    continue;
                }
                for x in squares.iter_mut() {
                    *x = scalar::exp(nearest - *x);
                }
                let mut lane = [0.0; LANES];
                add_products(&mut lane, weights, squares);
                total += folded(&lane);
            }
            if nearest == f64::INFINITY {
                f64::NEG_INFINITY
            } else {
                total.ln() - nearest
            }
        },
    )
}

/// `sum_j w_j k_j` with `k_j = exp(-|z - z_j|^2/2)`; adds `weight k_j` to `sums[j]`: both halves of a symmetric kernel matrix.
pub(crate) fn cross_sums<const D: usize>(
    white: &[&[f64]; D],
    weights: &[f64],
    z: &[f64; D],
    weight: f64,
    sums: &mut [f64],
) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let mut buffer = [0.0; BLOCK];
            let mut lane = [0.0; LANES];
            for (block, (weights, sums)) in weights.chunks(BLOCK).zip(sums.chunks_mut(BLOCK)).enumerate() {
                let kernels = &mut buffer[..weights.len()];
                half_squares(white, z, block * BLOCK, kernels);
                for (x, sum) in kernels.iter_mut().zip(sums) {
                    *x = scalar::exp(-*x);
                    *sum += weight * *x;
                }
                add_products(&mut lane, weights, kernels);
            }
            folded(&lane)
        },
    )
}

/// The plain form in which an estimate is stored.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
struct Stored<const D: usize> {
    particles: Particles<D>,
    kernel: Vec<Vec<f64>>,
}

impl<const D: usize> From<KernelEstimate<D>> for Stored<D> {
    fn from(estimate: KernelEstimate<D>) -> Self {
        Self {
            kernel: (0..D)
                .map(|i| estimate.kernel.row(i).iter().copied().collect())
                .collect(),
            particles: estimate.particles,
        }
    }
}

impl<const D: usize> TryFrom<Stored<D>> for KernelEstimate<D> {
    type Error = Error;

    fn try_from(stored: Stored<D>) -> Result<Self, Error> {
        if stored.kernel.len() != D || stored.kernel.iter().any(|row| row.len() != D) {
            return Err(fewbits_numerics::ArgumentError::new(
                "kernel",
                "of another shape",
                format!("{D} by {D} numbers"),
            )
            .into());
        }
        let kernel = SMatrix::from_fn(|i, j| stored.kernel[i][j]);
        Self::new(stored.particles, kernel)
    }
}
