//! Expectation-maximisation that fits a mixture to a kernel estimate, with a lower limit of the covariances.

use crate::Error;
use crate::plug_in::Cubature;
use crate::reduction::em::{Limits, Points, step};
use fewbits_core::Belief;
use fewbits_densities::{Component, KernelEstimate, Mixture};
use fewbits_numerics::linalg::symmetrised;
use nalgebra::SVector;

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
    let points = cubature(estimate, rule);
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
    let limits = Limits {
        variances: SVector::repeat(1.0),
        weight: f64::MIN_POSITIVE,
    };
    for _ in 0..iterations {
        step(&points, &mut parts, &limits, false)?;
    }
    let back = parts.iter().map(|p| {
        let covariance = white.lower * p.covariance() * white.lower.transpose();
        Component::new(p.weight(), white.lower * p.mean() + origin, symmetrised(&covariance))
    });
    Mixture::new(back.collect::<Result<_, _>>()?)
}

/// The cubature points of all kernels in whitened coordinates.
fn cubature<const D: usize>(estimate: &KernelEstimate<D>, rule: Cubature) -> Points<D> {
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
    Points::new(&all)
}
