//! Process noise learnt on line.

use crate::Error;
use fewbits_numerics::error::{non_negative, positive, refuse};

/// Process noise learnt from the signs of neighbouring residuals: `ln Q <- ln Q + gain b_k b_(k-1)`.
///
/// Residuals of a right model are independent; if `Q` is too small they repeat, if too large they alternate. It costs no bits and works
/// from one bit per sample on. On signals of bursts and rests one scale is not enough ([`NoiseBank`](crate::NoiseBank)).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseLearning {
    /// Step of `ln Q` per observation; .03 follows a ninefold jump within 200 samples, .01 is finer and slower.
    pub gain: f64,
    /// Smallest and largest factor of the stated process noise.
    pub range: [f64; 2],
}

impl NoiseLearning {
    /// Steps of .03, within a factor of 1000 to either side.
    pub const DEFAULT: Self = Self {
        gain: 0.03,
        range: [1e-3, 1e3],
    };

    pub(super) fn check(&self) -> Result<(), Error> {
        non_negative("gain", self.gain)?;
        positive("range", self.range[0])?;
        positive("range", self.range[1])?;
        if self.range[0] > self.range[1] {
            return refuse("range", format!("{:?}", self.range), "the smaller factor first");
        }
        Ok(())
    }
}
