//! Kernel density estimates: weighted particles under one common Gaussian kernel.

use crate::matrix::Factored;
use crate::{Bandwidth, Component, Error, Mixture, Particles};
use fewbits_core::Columns;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::kernels::{sum, vectorised};
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
        if !fewbits_core::columns::lengths_agree(&columns, out) {
            return;
        }
        let points = whitened(&self.factor, &self.origin, &columns, 0..out.len());
        let weights = self.particles.weights();
        let offset = self.factor.half_log_det + D as f64 * LN_SQRT_2PI;
        let white = self.white.each_ref().map(Vec::as_slice);
        vectorised(
            #[inline(always)]
            || {
                let point = |p: usize| -> [f64; D] { std::array::from_fn(|d| points[d][p]) };
                let last = out.len().saturating_sub(1);
                let (pairs, odd) = out.as_chunks_mut::<2>();
                for (k, logs) in pairs.iter_mut().enumerate() {
                    let points = [point(2 * k), point(2 * k + 1)];
                    *logs = log_kernel_sums(&white, weights, &points).map(|log| log - offset);
                }
                for log in odd {
                    *log = log_kernel_sums(&white, weights, &[point(last)])[0] - offset;
                }
            },
        );
    }

    /// `ln p` at every centre, exact in the tails: a centre of weight zero may be far from all others. Half the kernels of
    /// [`log_pdf_columns`](Self::log_pdf_columns): they are symmetric.
    pub fn log_pdf_at_centres(&self) -> Vec<f64> {
        let weights = self.particles.weights();
        let mut sums = weights.to_vec();
        let white = self.white.each_ref().map(Vec::as_slice);
        let mut start = 0;
        // Runs of centres against themselves one by one, against all that follow as a rectangle.
        while start < self.len() {
            let end = (start + RUN).min(self.len());
            let (before, after) = sums.split_at_mut(end);
            let own = &mut before[start..];
            for i in start..end {
                let (one, rest) = own[i - start..].split_at_mut(1);
                add_cross_sums(
                    (&chunk_of(&white, i, 1), &weights[i..=i], one),
                    (&chunk_of(&white, i + 1, end - i - 1), &weights[i + 1..end], rest),
                );
            }
            add_cross_sums(
                (&chunk_of(&white, start, end - start), &weights[start..end], own),
                (&chunk_of(&white, end, self.len() - end), &weights[end..], after),
            );
            start = end;
        }
        let offset = self.factor.half_log_det + D as f64 * LN_SQRT_2PI;
        let log = |(i, sum): (usize, &f64)| {
            if *sum > TINY {
                sum.ln() - offset
            } else {
                log_far_sum(&white, weights, &std::array::from_fn(|d| white[d][i])) - offset
            }
        };
        sums.iter().enumerate().map(log).collect()
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

/// Lanes of the sums over kernels.
pub(crate) const LANES: usize = 8;
/// Centres that are paired with each other one by one.
const RUN: usize = 16;
/// `log2(e)/2`: half squares in powers of two.
const HALF_LOG2_E: f64 = 0.5 * std::f64::consts::LOG2_E;
/// Sums of kernels below this (`2^-900`) are taken again with the nearest centre taken out.
const TINY: f64 = 1.183_053_447e-271;
/// Exponents of two beyond this count as this: such a kernel is `2^-1020`.
const FARTHEST: f64 = 1020.0;
/// `2^52 + 2^51`: adding it leaves the nearest integer in the low bits of the mantissa.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// `2^f` on `|f| <= 1/2`, interpolated at Chebyshev nodes with 50 digits; relative error 3e-16.
const EXP2: [f64; 11] = [
    1.0,
    std::f64::consts::LN_2,
    0.240_226_506_959_100_98,
    0.055_504_108_664_447_72,
    0.009_618_129_107_606_888,
    0.001_333_355_823_016_497_4,
    0.000_154_035_304_417_360_5,
    1.525_265_726_020_083_7e-5,
    1.321_544_258_792_169e-6,
    1.020_869_029_995_830_6e-7,
    7.072_585_949_269_223e-9,
];

/// `2^-s` for `s >= 0`, within three units in the last place down to `2^-1020`, where it stays. A third of the work of a whole
/// exponential: neither subnormal results nor a second part of the argument.
#[inline(always)]
pub(crate) fn power_of_half(s: f64) -> f64 {
    let s = if s < FARTHEST { s } else { FARTHEST };
    let shifted = ROUNDER - s;
    let f = (ROUNDER - shifted) - s;
    let mut p = EXP2[10];
    for c in EXP2[..10].iter().rev() {
        p = p * f + c;
    }
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}

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

/// Adds the lanes in a fixed order.
#[inline(always)]
pub(crate) fn folded(lane: &[f64; LANES]) -> f64 {
    ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]))
}

/// `count` centres from `from` on: a shape whose bounds are checked once.
#[inline(always)]
fn chunk_of<'a, const D: usize>(white: &[&'a [f64]; D], from: usize, count: usize) -> [&'a [f64]; D] {
    std::array::from_fn(|d| &white[d][from..from + count])
}

/// `sum_j w_j 2^-(s_j - offset)` of each point over all centres; exponents below the offset count as equal to it.
#[inline(always)]
fn kernel_sums<const D: usize, const P: usize>(
    white: &[&[f64]; D],
    weights: &[f64],
    points: &[[f64; D]; P],
    offset: f64,
) -> [f64; P] {
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
    lane.map(|lane| folded(&lane))
}

/// `ln sum_j w_j exp(-|z - z_j|^2/2)` of each point, exact in the tails: where the plain sum is tiny, it is taken again with the
/// nearest centre taken out.
#[inline(always)]
fn log_kernel_sums<const D: usize, const P: usize>(
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
fn log_far_sum<const D: usize>(white: &[&[f64]; D], weights: &[f64], z: &[f64; D]) -> f64 {
    // Centres of weight zero may be nearer; they add nothing.
    let nearest = (0..weights.len())
        .filter(|i| weights[*i] > 0.0)
        .map(|i| exponent(white, z, i))
        .fold(f64::INFINITY, f64::min);
    if nearest == f64::INFINITY {
        return f64::NEG_INFINITY;
    }
    let [sum] = kernel_sums(white, weights, &[*z], nearest);
    sum.ln() - nearest / std::f64::consts::LOG2_E
}

/// Centres of a block of [`add_cross_sums`].
const BLOCK: usize = 32;

/// Kernels `k_ij = exp(-|z_i - z_j|^2/2)` between two runs of centres, `(white, weights, sums)` each: adds `sum_j w_j k_ij` to the
/// first sums and `sum_i w_i k_ij` to the second.
pub(crate) fn add_cross_sums<const D: usize>(
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

/// `sum_j w_j k_j` of each point; adds the points' weighted kernels to `sums`: both halves of a symmetric kernel matrix.
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
        // Filled up with centres of weight zero.
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
    lane.map(|lane| folded(&lane))
}

/// A short run filled up with zeros.
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

/// The plain form in which an estimate is stored.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
struct Stored<const D: usize> {
    particles: Particles<D>,
    #[serde(with = "fewbits_numerics::stored")]
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
