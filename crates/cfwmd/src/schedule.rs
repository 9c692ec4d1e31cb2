//! Innovation covariances computed before deployment: the rate of covariance feedback without sending a covariance.

use crate::Error;
use crate::network::Network;
use fewbits_core::{Belief, Gaussian, Likelihood, LinearDynamics, LinearSensing};
use fewbits_filters::kalman;
use fewbits_numerics::error::at_least_one;
use nalgebra::SMatrix;
use rand::Rng;

/// Expected predicted covariance `E[P_{k|k-1}]` at the fusion centre for `k = 1..=steps`. The network with covariance feedback is
/// simulated `runs` times; a few hundred runs are enough. The sensors receive the result once.
///
/// ```text
/// repeat: truth from the start belief; each step: P_k += P, rules from P, values and silences, assumed-density update
/// ```
///
/// # Errors
/// If `steps` or `runs` is zero, or the network refuses an argument.
pub fn expected_covariances<const D: usize, const M: usize, S, R: Rng>(
    rng: &mut R,
    network: &Network<S, D, M>,
    dynamics: &impl LinearDynamics<D>,
    start: &Gaussian<D>,
    steps: usize,
    runs: usize,
) -> Result<Vec<SMatrix<f64, D, D>>, Error>
where
    S: LinearSensing<D, M> + Clone + PartialEq,
{
    at_least_one("steps", steps)?;
    at_least_one("runs", runs)?;
    let mut sums = vec![SMatrix::zeros(); steps];
    for _ in 0..runs {
        let (mut truth, mut belief) = (start.sample(rng), *start);
        for sum in &mut sums {
            truth = dynamics.propagate(rng, &truth);
            let predicted = kalman::predict(dynamics, &belief);
            *sum += predicted.covariance();
            // One step with covariance feedback.
            let rules = network.rules_under(&predicted)?;
            let measurements: Vec<_> = network.sensors().iter().map(|s| s.sample(rng, &truth)).collect();
            let (observations, _) = network.transmit(rng, &rules, predicted.mean(), &measurements)?;
            belief = predicted;
            let observed: Vec<_> = observations.into_iter().map(Some).collect();
            network
                .likelihoods(&rules, predicted.mean(), &observed)?
                .condition(&mut belief)?;
        }
    }
    Ok(sums.into_iter().map(|sum| sum / runs as f64).collect())
}
