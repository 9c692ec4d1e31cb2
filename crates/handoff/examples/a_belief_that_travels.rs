//! A leader's belief handed on each second, whole and in fewer and fewer components.
//!
//! `cargo run -p fewbits-handoff --example a_belief_that_travels`

use fewbits_core::factor::Value;
use fewbits_core::{Belief, Dynamics, Gaussian, LinearSensing, Observed, Sensing};
use fewbits_densities::Mixture;
use fewbits_handoff::{Components, HandoffFilter};
use fewbits_models::{ScalarSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let walk = constant_velocity_1d(1.0, 0.04)?;
    let sensor = ScalarSensor::scalar(Vector2::new(1.0, 0.0), 1.0)?;
    let prior = Gaussian::new(Vector2::new(0.0, 1.0), Matrix2::identity())?;
    for components in [1, 3, 10] {
        let leader = HandoffFilter::new(500, Components::new(components))?;
        let (mut world, mut rng) = (Stream::new(1).rng(), Stream::new(2).rng());
        let (mut truth, mut known) = (Vector2::new(0.0, 1.0), Mixture::single(&prior)?);
        let (mut squares, mut log_likelihood) = (0.0, 0.0);
        for _ in 0..50 {
            truth = walk.propagate(&mut world, &truth);
            let measured = Value::new(sensor.sample(&mut world, &truth), *sensor.noise_covariance())?;
            let (handover, info) = leader.step(&mut rng, &known, &walk, &Observed::new(sensor, measured))?;
            known = handover.into_mixture();
            squares += (known.mean()[0] - truth[0]).powi(2);
            log_likelihood += info.log_likelihood;
        }
        println!(
            "{components:2} components: rms error of the position {:.3}, log-likelihood {log_likelihood:.2}",
            (squares / 50.0_f64).sqrt()
        );
    }
    Ok(())
}
