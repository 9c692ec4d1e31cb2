//! Two censoring sensors and one message per step over links that lose a tenth: a target followed for twenty steps.

use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Dynamics, Gaussian, Likelihood, Link, Sensing};
use fewbits_filters::kalman;
use fewbits_models::{LinearSensor, constant_velocity_1d};
use nalgebra::Vector2;
use rand::SeedableRng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
    let dynamics = constant_velocity_1d(1.0, 4.0)?; // 1 s, (m/s^2)^2
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0)?; // position, 1 m^2
    let network = Network::new(vec![sensor; 2], Budget::new(1.0, 2)?.threshold(1)?, Link::lossy(0.1)?)?;
    let mut truth = Vector2::new(0.0, 10.0);
    let mut belief = Gaussian::known(truth)?;
    for k in 1..=20 {
        truth = dynamics.propagate(&mut rng, &truth);
        let predicted = kalman::predict(&dynamics, &belief); // broadcast
        let rules = network.rules_under(&predicted)?;
        let measurements: Vec<_> = (0..2).map(|_| sensor.sample(&mut rng, &truth)).collect();
        let (observations, sent) = network.transmit(&mut rng, &rules, predicted.mean(), &measurements)?;
        let observed: Vec<_> = observations.into_iter().map(Some).collect();
        belief = predicted;
        network
            .likelihoods(&rules, predicted.mean(), &observed)?
            .condition(&mut belief)?;
        let (error, deviation) = (belief.mean()[0] - truth[0], belief.standard_deviations()[0]);
        println!("{k:2}: {sent} sent, error {error:6.2} m, believed deviation {deviation:.2} m");
    }
    Ok(())
}
