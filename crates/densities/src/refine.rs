//! Expectation-maximisation towards a kernel estimate, with a floor under the covariances.

use crate::matrix::{Factored, eigen, log_forms};
use crate::{Component, Cubature, Error, KernelEstimate, Mixture};
use fewbits_numerics::kernels::{dot, scalar, sum, vectorised, weighted_covariance};
use nalgebra::{SMatrix, SVector};

/// Improves a mixture as an approximation of a kernel estimate by `iterations` steps of expectation-maximisation over the
/// cubature points of every kernel. Each step lowers the KL of the points' law.
///
/// No eigenvalue of a component's covariance falls below the kernel's (in coordinates where the kernel is the identity):
/// without that floor components collapse onto cubature points. Components that lose all mass are dropped.
///
/// ```text
/// points y_p, v_p        = centres + kernel offsets, weights times shares     whitened: kernel = I
/// repeat: r_pk           = w_k N(y_p; m_k, S_k) / sum_j w_j N(y_p; m_j, S_j)
///         w_k, m_k, S_k  = moments of the points under v_p r_pk
///         S_k            = S_k with eigenvalues raised to 1
/// ```
///
/// # Errors
/// Never for a valid estimate and mixture.
pub fn refine<const D: usize>(
    estimate: &KernelEstimate<D>,
    mixture: &Mixture<D>,
    iterations: usize,
    rule: Cubature,
) -> Result<Mixture<D>, Error> {
    let points = Points::new(estimate, rule);
    let origin = estimate.particles().mean();
    let white = estimate.factor();
    let mut parts: Vec<Part<D>> = mixture
        .components()
        .iter()
        .filter(|c| c.weight() > 0.0)
        .map(|c| {
            let mean = white.whitener * (c.mean() - origin);
            let covariance = white.whitener * c.covariance() * white.whitener.transpose();
            Part::new(c.weight(), mean, covariance)
        })
        .collect::<Result<_, _>>()?;
    let mut shares = vec![0.0; parts.len() * points.len()];
    for _ in 0..iterations {
        step(&points, &mut parts, &mut shares)?;
    }
    let back = parts.iter().map(|p| {
        let covariance = white.lower * p.covariance * white.lower.transpose();
        Component::new(p.weight, white.lower * p.mean + origin, (covariance + covariance.transpose()) * 0.5)
    });
    Mixture::new(back.collect::<Result<_, _>>()?)
}

/// The cubature points of all kernels in whitened coordinates.
struct Points<const D: usize> {
    columns: [Vec<f64>; D],
    weights: Vec<f64>,
}

impl<const D: usize> Points<D> {
    fn new(estimate: &KernelEstimate<D>, rule: Cubature) -> Self {
        let weights = estimate.particles().weights();
        let kept: Vec<usize> = (0..weights.len()).filter(|i| weights[*i] > 0.0).collect();
        let offsets = rule.points::<D>();
        let white = estimate.white();
        let columns = std::array::from_fn(|d| {
            offsets
                .iter()
                .flat_map(|(z, _)| kept.iter().map(move |i| white[d][*i] + z[d]))
                .collect()
        });
        let weights = offsets
            .iter()
            .flat_map(|(_, share)| kept.iter().map(move |i| weights[*i] * share))
            .collect();
        Self { columns, weights }
    }

    fn len(&self) -> usize {
        self.weights.len()
    }
}

struct Part<const D: usize> {
    weight: f64,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
    factor: Factored<D>,
}

impl<const D: usize> Part<D> {
    fn new(weight: f64, mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Result<Self, Error> {
        let covariance = (covariance + covariance.transpose()) * 0.5;
        Ok(Self {
            weight,
            mean,
            covariance,
            factor: Factored::new("covariance", &covariance)?,
        })
    }

    /// Writes `ln w + ln N(y; mean, covariance)` of every point, a constant left out, and keeps the largest.
    fn log_terms(&self, columns: &[&[f64]; D], row: &mut [f64], largest: &mut [f64]) {
        let offset = self.weight.ln() - self.factor.half_log_det;
        vectorised(
            #[inline(always)]
            || {
                log_forms(&self.factor, &self.mean, offset, columns, row);
                for (largest, x) in largest.iter_mut().zip(row.iter()) {
                    *largest = if *x > *largest { *x } else { *largest };
                }
            },
        );
    }
}

/// One step. `shares` is room for the responsibilities, one row per part.
fn step<const D: usize>(points: &Points<D>, parts: &mut Vec<Part<D>>, shares: &mut [f64]) -> Result<(), Error> {
    const BLOCK: usize = 256;
    let n = points.len();
    let k = parts.len();
    let mut largest = [0.0; BLOCK];
    let mut total = [0.0; BLOCK];
    let mut logs = vec![0.0; BLOCK * k];
    for from in (0..n).step_by(BLOCK) {
        let m = BLOCK.min(n - from);
        let columns: [&[f64]; D] = points.columns.each_ref().map(|c| &c[from..from + m]);
        largest.fill(f64::NEG_INFINITY);
        for (part, row) in parts.iter().zip(logs.chunks_mut(BLOCK)) {
            part.log_terms(&columns, &mut row[..m], &mut largest[..m]);
        }
        vectorised(
            #[inline(always)]
            || {
                total[..m].fill(0.0);
                for (row, shares) in logs.chunks_exact(BLOCK).zip(shares.chunks_mut(n)) {
                    let shares = &mut shares[from..from + m];
                    for ((share, x), largest) in shares.iter_mut().zip(row).zip(&largest) {
                        *share = scalar::exp(x - largest);
                    }
                    total.iter_mut().zip(shares.iter()).for_each(|(t, s)| *t += s);
                }
                for (total, weight) in total[..m].iter_mut().zip(&points.weights[from..]) {
                    *total = weight / *total;
                }
                for shares in shares.chunks_mut(n).take(k) {
                    shares[from..from + m].iter_mut().zip(&total).for_each(|(s, t)| *s *= t);
                }
            },
        );
    }
    let mut next = Vec::with_capacity(k);
    for share in shares.chunks(n).take(k) {
        let weight = sum(share);
        if weight > f64::MIN_POSITIVE {
            next.push(moments(points, share, weight)?);
        }
    }
    *parts = next;
    Ok(())
}

/// Moments of the points under the given shares, with the eigenvalue floor.
fn moments<const D: usize>(points: &Points<D>, share: &[f64], weight: f64) -> Result<Part<D>, Error> {
    let mean = SVector::<f64, D>::from_fn(|d, _| dot(share, &points.columns[d]) / weight);
    let mut covariance = SMatrix::<f64, D, D>::zeros();
    for a in 0..D {
        for b in 0..=a {
            let entry = weighted_covariance(share, (&points.columns[a], mean[a]), (&points.columns[b], mean[b]));
            covariance[(a, b)] = entry / weight;
            covariance[(b, a)] = entry / weight;
        }
    }
    let (values, vectors) = eigen(&covariance);
    if values.iter().any(|v| *v < 1.0) {
        let raised = vectors * SMatrix::from_diagonal(&values.map(|v| v.max(1.0))) * vectors.transpose();
        covariance = (raised + raised.transpose()) * 0.5;
    }
    Part::new(weight, mean, covariance)
}
