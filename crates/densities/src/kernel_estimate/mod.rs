//! Kernel density estimates: weighted particles under one common Gaussian kernel.

mod bandwidth;
mod sums;

pub use bandwidth::{Bandwidth, BandwidthRule, SampleSize, Shape};
pub use sums::add_cross_sums;

use crate::Error;
use crate::mixture::{Component, Mixture};
use crate::particles::{Particles, systematic};
use fewbits_core::columns::{change_each, state_at};
use fewbits_core::{Belief, Columns, ColumnsMut, Density};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::factored::Factored;
use fewbits_numerics::kernels::vectorised;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use sums::{RUN, TINY, chunk_of, log_far_sum, log_kernel_sums};

/// A density `sum_i w_i N(x; x_i, H)`: weighted particles, each replaced by a Gaussian kernel of covariance `H`.
///
/// The centres are also stored in coordinates in which the kernel is standard normal. The evaluation of a kernel then takes `D`
/// differences and one exponential.
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
    /// An estimate from particles and the covariance of the kernel.
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

    /// An estimate from particles, with the kernel that a bandwidth rule gives.
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
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// The kernel's covariance, factored.
    pub fn kernel_factor(&self) -> &Factored<D> {
        &self.factor
    }

    /// The centres relative to the sample's mean, in coordinates in which the kernel is standard normal; one column per coordinate.
    pub fn whitened_centres(&self) -> &[Vec<f64>; D] {
        &self.white
    }

    /// `ln p(x)`, never NaN for finite `x`.
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> f64 {
        let columns: [[f64; 1]; D] = std::array::from_fn(|d| [x[d]]);
        let mut out = [0.0];
        self.log_pdf_columns(columns.each_ref().map(<[f64; 1]>::as_slice), &mut out);
        out[0]
    }

    /// Writes `ln p` of every point of `columns` to `out`, accurate in the tails. Evaluates one kernel per particle and point.
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
                // Two points at a time: each centre is loaded once for both.
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

    /// `ln p` at every centre, accurate in the tails (a centre of weight zero may be far from all others). By symmetry it takes half the
    /// kernel evaluations of [`log_pdf_columns`](Self::log_pdf_columns).
    pub fn log_pdf_at_centres(&self) -> Vec<f64> {
        let weights = self.particles.weights();
        let mut sums = weights.to_vec();
        let white = self.white.each_ref().map(Vec::as_slice);
        let mut start = 0;
        // Centres are taken in runs. Pairs within a run are evaluated one by one, pairs with all later centres as a rectangular block.
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
    /// If the kernel is not positive definite, which cannot happen for an estimate that was constructed.
    pub fn to_mixture(&self) -> Result<Mixture<D>, Error> {
        let components = (0..self.len())
            .filter(|i| self.particles.weights()[*i] > 0.0)
            .map(|i| Component::new(self.particles.weights()[i], state_at(&self.particles.columns(), i), self.kernel));
        Mixture::new(components.collect::<Result<_, _>>()?)
    }

    /// `count` equally weighted draws: centres by systematic selection, each moved by a draw of the kernel.
    ///
    /// # Errors
    /// If `count` is 0.
    pub fn sample_systematic<R: Rng + ?Sized>(&self, rng: &mut R, count: usize) -> Result<Particles<D>, Error> {
        at_least_one("count", count)?;
        let mut chosen = systematic(self.particles.weights(), count, rng.random()).into_iter();
        let columns = self.particles.columns();
        Particles::from_draws(count, || {
            let i = chosen.next().unwrap_or(0);
            let z = SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal));
            state_at(&columns, i) + self.factor.lower * z
        })
    }
}

/// Coordinates `L^-1 (x - origin)` of the columns' points in `range`.
fn whitened<const D: usize>(
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

impl<const D: usize> Belief<D> for KernelEstimate<D> {
    fn mean(&self) -> SVector<f64, D> {
        self.particles.mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        self.particles.covariance() + self.kernel
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, D>) {
        let drawn = states.each_mut().map(|column| &mut **column);
        self.particles().sample_columns(rng, drawn);
        change_each(states, |centre| {
            centre + self.factor.lower * SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal))
        });
    }
}

impl<const D: usize> Density<D> for KernelEstimate<D> {
    crate::own_log_pdf!();
}

/// The stored form of [`KernelEstimate`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    kernel: [[f64; D]; D],
    particles: Particles<D>,
}

impl<const D: usize> From<KernelEstimate<D>> for Stored<D> {
    fn from(estimate: KernelEstimate<D>) -> Self {
        Self {
            kernel: estimate.kernel.into(),
            particles: estimate.particles,
        }
    }
}

impl<const D: usize> TryFrom<Stored<D>> for KernelEstimate<D> {
    type Error = Error;

    fn try_from(parts: Stored<D>) -> Result<Self, Error> {
        KernelEstimate::new(parts.particles, parts.kernel.into())
    }
}
