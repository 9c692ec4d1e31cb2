//! Scheduled thresholds: the rate of covariance feedback without feeding a covariance back.

use crate::Error;
use crate::message::Format;
use crate::network::{CensoringSensor, Network};
use fewbits_core::{Dynamics, Encoder, Gaussian, LinearDynamics, Sensing};
use fewbits_filters::kalman;
use fewbits_numerics::error::at_least_one;
use nalgebra::SMatrix;
use rand::{Rng, RngExt};

/// Expected predicted covariance `E[P_{k|k-1}]` at the fusion centre for `steps` steps, by simulating the network with
/// covariance feedback `runs` times. A few hundred runs are enough; the sensors are given the result once.
///
/// ```text
/// repeat: truth from the start belief; each step: P_k += P, rules from P, values and silences, assumed-density update
/// ```
///
/// # Errors
/// No step, no run; arguments that the network refuses.
pub fn expected_covariances<const D: usize, const M: usize, R: Rng + ?Sized>(
    rng: &mut R,
    network: &Network<D, M>,
    dynamics: &impl LinearDynamics<D>,
    start: &Gaussian<D>,
    steps: usize,
    runs: usize,
) -> Result<Vec<SMatrix<f64, D, D>>, Error> {
    at_least_one("steps", steps)?;
    at_least_one("runs", runs)?;
    let mut sums = vec![SMatrix::zeros(); steps];
    let (mut rules, mut heard) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let mut truth = start.sample(rng)?;
        let mut belief = *start;
        for sum in &mut sums {
            truth = Dynamics::propagate(dynamics, rng, &truth);
            let predicted = kalman::predict(dynamics, &belief);
            *sum += predicted.covariance();
            rules.clear();
            heard.clear();
            for (i, sensor) in network.sensors().iter().enumerate() {
                let half = CensoringSensor {
                    rule: network.rule_under(i, predicted.covariance())?,
                    format: Format::Double,
                };
                let measurement = sensor.sample(rng, &truth);
                let report = half.encode(&measurement, &(sensor.matrix() * predicted.mean()));
                let arrives = network.loss() == 0.0 || rng.random::<f64>() >= network.loss();
                heard.push(if arrives {
                    report.heard()
                } else {
                    fewbits_core::Observation::Silent
                });
                rules.push(half.rule);
            }
            belief = network.fuse(&predicted, &rules, predicted.mean(), &heard)?.0;
        }
    }
    Ok(sums.into_iter().map(|sum| sum / runs as f64).collect())
}
