//! One sensor with a one-bit quantizer.

use crate::observation::source::noise_in_range;
use crate::{BinaryQuantizer, Error};
use fewbits_numerics::stored;
use serde::{Deserialize, Serialize};

/// One sensor: what it measures is `Y = X + N(0, noise_std^2)`, what it reports is the bit of its quantizer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredSensor", into = "StoredSensor")]
pub struct PatternSensor {
    quantizer: BinaryQuantizer,
    noise_std: f64,
}

stored! { PatternSensor as StoredSensor |sensor| {
    quantizer: BinaryQuantizer = sensor.quantizer,
    noise_std: f64 = sensor.noise_std,
} => PatternSensor::with_deviation(quantizer, noise_std), Error }

impl PatternSensor {
    /// A sensor from its quantizer and the standard deviation (not the variance) of its noise.
    ///
    /// # Errors
    /// If `noise_std` is not positive and finite.
    pub fn with_deviation(quantizer: BinaryQuantizer, noise_std: f64) -> Result<Self, Error> {
        let noise_std = noise_in_range(noise_std)?;
        Ok(Self { quantizer, noise_std })
    }

    /// Its quantizer.
    pub fn quantizer(&self) -> &BinaryQuantizer {
        &self.quantizer
    }

    /// Standard deviation of its noise.
    pub fn noise_std(&self) -> f64 {
        self.noise_std
    }

    /// `[P(0|x), P(1|x)]`.
    pub fn probabilities(&self, x: f64) -> [f64; 2] {
        self.quantizer.probabilities(x, self.noise_std)
    }

    /// `[ln P(0|x), ln P(1|x)]`.
    pub fn log_probabilities(&self, x: f64) -> [f64; 2] {
        self.quantizer.log_probabilities(x, self.noise_std)
    }

    /// Fisher information about `x` in its bit.
    pub fn fisher_information(&self, x: f64) -> f64 {
        self.quantizer.fisher_information(x, self.noise_std)
    }
}
