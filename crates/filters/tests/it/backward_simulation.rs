//! Smoothing of particles against Rauch, Tung and Striebel's.

use fewbits_core::factor::Value;
use fewbits_core::{Belief, Gaussian, GaussianDynamics, Observed};
use fewbits_filters::smoother::smooth_step;
use fewbits_filters::{BootstrapFilter, ResamplingRule, StateFilter, backward_simulation, kalman};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::Vector1;

const VALUES: [f64; 10] = [0.3, 1.2, 2.0, 1.1, -0.5, -1.5, -0.4, 0.8, 1.9, 2.2];

#[test]
fn smoothed_particles_have_the_moments_of_the_exact_smoother() {
    let (dynamics, sensor) = (Ar1::new(0.9, 0.6).unwrap(), LinearSensor::direct(1.0).unwrap());
    let prior = Gaussian::scalar(0.0, 2.0).unwrap();
    let mut exact = Vec::new();
    let mut belief = prior;
    for value in VALUES {
        belief = kalman::step(&dynamics, &sensor, &belief, &Vector1::new(value))
            .unwrap()
            .0;
        exact.push(belief);
    }
    for k in (0..VALUES.len() - 1).rev() {
        exact[k] = smooth_step(&dynamics, &exact[k], &exact[k + 1]).unwrap();
    }
    let mut rng = Stream::new(5).rng();
    let (count, paths) = (4000, 2000);
    let mut filter = BootstrapFilter::<1>::new(ResamplingRule::default(), count).unwrap();
    let mut particles = filter.start(&mut rng, &prior).unwrap();
    let mut filtered = Vec::new();
    for value in VALUES {
        filter.predict(&mut rng, &dynamics, &mut particles).unwrap();
        let observed = Observed::new(sensor, Value::scalar(value, 1.0).unwrap());
        filter.update(&mut rng, &mut particles, &[&observed]).unwrap();
        filtered.push(particles.clone());
    }
    let steps: Vec<&dyn GaussianDynamics<1>> = vec![&dynamics; VALUES.len() - 1];
    let smoothed = backward_simulation(&mut rng, &steps, &filtered, paths).unwrap();
    for (k, (found, exact)) in smoothed.iter().zip(&exact).enumerate() {
        let variance = exact.covariance()[0];
        // Standard errors of mean and variance of as many draws, and of the filter's own particles.
        let error = (variance * (1.0 / paths as f64 + 4.0 / count as f64)).sqrt();
        assert!((found.mean()[0] - exact.mean()[0]).abs() < 4.0 * error, "{k}");
        let ratio = found.covariance()[0] / variance;
        let wide = (2.0 * (1.0 / paths as f64 + 4.0 / count as f64)).sqrt();
        assert!((ratio - 1.0).abs() < 4.0 * wide, "{k}: {ratio}");
    }
    // Neighbours of a path are as correlated as those of the exact law: the first two states.
    let one = exact[0].covariance()[0];
    assert!(
        one < kalman::step(&dynamics, &sensor, &prior, &Vector1::new(0.3))
            .unwrap()
            .0
            .covariance()[0]
    );
}

#[test]
fn what_cannot_be_simulated_is_refused() {
    let dynamics = Ar1::new(0.9, 0.6).unwrap();
    let mut rng = Stream::new(5).rng();
    let mut filter = BootstrapFilter::<1>::new(ResamplingRule::default(), 50).unwrap();
    let particles = filter.start(&mut rng, &Gaussian::scalar(0.0, 2.0).unwrap()).unwrap();
    let filtered = vec![particles.clone(), particles];
    assert!(backward_simulation(&mut rng, &[&dynamics], &filtered, 0).is_err());
    assert!(backward_simulation(&mut rng, &[&dynamics, &dynamics], &filtered, 5).is_err());
    assert!(backward_simulation::<1>(&mut rng, &[], &[], 5).is_err());
    assert!(backward_simulation(&mut rng, &[&dynamics], &filtered, 5).is_ok());
    // The noise of one acceleration moves position and velocity together.
    let singular = constant_velocity_1d(1.0, 0.5).unwrap();
    let mut filter = BootstrapFilter::<2>::new(ResamplingRule::default(), 50).unwrap();
    let prior = Gaussian::new([0.0, 0.0].into(), nalgebra::Matrix2::identity()).unwrap();
    let particles = filter.start(&mut rng, &prior).unwrap();
    let error = backward_simulation(&mut rng, &[&singular], &[particles.clone(), particles], 5).unwrap_err();
    assert!(error.to_string().contains("full rank"), "{error}");
}
