//! Dynamics whose noise grows with the state: the grid filter against the exact moments.

use fewbits_core::{Dynamics, GaussianDynamics};
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid};
use nalgebra::{Matrix1, Vector1};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// `x' = x / 2 + sqrt(1/2 + x^2 / 5) u`.
struct Swelling;

impl Swelling {
    fn variance(x: f64) -> f64 {
        0.5 + 0.2 * x * x
    }
}

impl Dynamics<1> for Swelling {
    fn mean(&self, state: &Vector1<f64>) -> Vector1<f64> {
        state * 0.5
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &Vector1<f64>) -> Vector1<f64> {
        self.mean(state)
            .add_scalar(Self::variance(state[0]).sqrt() * rng.sample::<f64, _>(StandardNormal))
    }
}

impl GaussianDynamics<1> for Swelling {
    fn jacobian(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(0.5)
    }

    fn noise_covariance_at(&self, state: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(Self::variance(state[0]))
    }
}

#[test]
fn a_grid_moves_with_noise_of_its_own_at_every_node() {
    let filter = TransitionKernel::new(&Swelling, UniformGrid::symmetric(20.0, 0.1).unwrap()).unwrap();
    let belief = PointMass::normal(*filter.grid(), 2.0, 1.5).unwrap();
    let moved = filter.predict(&belief).unwrap();
    // E x' = 1 and E x'^2 = E [x^2 / 4 + 1/2 + x^2 / 5] = 1/2 + 0.45 (1.5 + 4).
    let variance = 0.5 + 0.45 * 5.5 - 1.0;
    assert!((moved.mean() - 1.0).abs() < 1e-9, "{}", moved.mean());
    assert!((moved.variance() - variance).abs() < 1e-8, "{} against {variance}", moved.variance());
}
