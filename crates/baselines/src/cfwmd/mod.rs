//! The published closed loop over bits, and comparisons of the publications: silence ignored, a random trigger, and withheld
//! measurements imputed.

pub mod centre;
mod cross_covariance;
pub mod imputing;
pub mod information;
mod particles;
pub mod trigger;
mod weighing;

pub use cross_covariance::cross_covariance_step;
pub use imputing::ImputedBelief;
pub use particles::likelihood_of_particles;
pub use weighing::Weighing;

use fewbits_cfwmd::Error;
use fewbits_cfwmd::network::Network;
use fewbits_core::{Gaussian, LinearSensing, Observation};
use fewbits_filters::{Info, kalman};
use fewbits_numerics::error::entries;
use nalgebra::SVector;

/// The baseline that ignores silence (the paper's CFoMD; all-send and random censoring use it too): a Kalman filter on the received
/// values.
///
/// # Errors
/// If there is not one observation per sensor, or a value is not finite.
pub fn fuse_received<S: LinearSensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    network: &Network<S, D, M>,
    predicted: &Gaussian<D>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<(Gaussian<D>, Info), Error> {
    entries("observations", observations.len(), network.sensors().len())?;
    let (mut belief, mut info) = (*predicted, Info::default());
    for (sensor, observation) in network.sensors().iter().zip(observations) {
        if let Observation::Received(value) = observation {
            let (next, update) = kalman::update(sensor, &belief, value)?;
            belief = next;
            info.log_likelihood += update.log_likelihood;
        }
    }
    Ok((belief, info))
}
