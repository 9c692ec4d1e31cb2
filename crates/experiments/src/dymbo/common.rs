//! What the Dymbo figures share.

use crate::prelude::*;
use fewbits_dymbo::ScalarPlant;
use std::f64::consts::FRAC_2_PI;

parameters! {
    /// A plant of unit measurement noise.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) point struct Plant {
        pub(super) a: f64 [-1.0..=1.0] => "Plant coefficient; one bit cannot hold an unstable plant.",
        pub(super) gamma: f64 [1e-6..=1e3] => "Process variance over measurement variance.",
    }
}

impl Plant {
    pub(super) fn model(&self) -> Result<ScalarPlant, Error> {
        Ok(ScalarPlant::new(self.a, self.gamma, 1.0)?)
    }

    /// Steady filtered variance of the Kalman filter.
    pub(super) fn kalman_variance(&self) -> Result<f64, Error> {
        Ok(self.model()?.steady_state(1.0)?.filtered_variance)
    }

    /// Steady filtered variance of the sign-bit filter.
    pub(super) fn sign_bit_variance(&self) -> Result<f64, Error> {
        Ok(self.model()?.steady_state(FRAC_2_PI)?.filtered_variance)
    }

    /// The belief about a plant that has run for ever.
    pub(super) fn stationary(&self) -> Result<Gaussian<1>, Error> {
        let variance = self.model()?.dynamics().stationary_variance();
        Ok(Gaussian::scalar(0.0, variance?)?)
    }

    /// Title of a panel.
    pub(super) fn title(&self) -> String {
        format!("a = {}, gamma = {}", self.a, self.gamma)
    }
}

/// Name of its random streams and references.
impl std::fmt::Display for Plant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.a, self.gamma)
    }
}

/// Plants from pairs of coefficient and noise ratio.
pub(super) fn plants<const N: usize>(pairs: [(f64, f64); N]) -> Vec<Plant> {
    pairs.map(|(a, gamma)| Plant { a, gamma }).into()
}

/// One coefficient with every noise ratio.
pub(super) fn each(a: f64, gamma: &[f64]) -> Vec<Plant> {
    gamma.iter().map(|gamma| Plant { a, gamma: *gamma }).collect()
}

/// `points` numbers from `10^low` to `10^high`, evenly spaced in the logarithm.
pub(super) fn log_spaced(low: f64, high: f64, points: usize) -> Vec<f64> {
    let step = (high - low) / (points.max(2) - 1) as f64;
    (0..points).map(|i| 10_f64.powf(low + i as f64 * step)).collect()
}
