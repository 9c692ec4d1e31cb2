//! Process noise learnt during operation.

use crate::Error;
use fewbits_numerics::error::{non_negative, positive, refuse};

/// Learns a scale of the process noise `Q` from the signs `b_k` of successive residuals: `ln Q <- ln Q + gain b_k b_(k-1)`.
///
/// Residuals of a right model are independent. If `Q` is too small they repeat their sign; if it is too large they alternate. Learning
/// takes no extra bits and works even with one bit per sample. If a signal alternates between bursts and rests, one scale is not enough;
/// use an [`Imm`](crate::Imm).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseLearning {
    /// Step of `ln Q` per observation. A step of .03 follows a ninefold jump within 200 samples; .01 is more accurate and slower.
    pub gain: f64,
    /// Smallest and largest factor by which the stated process noise is multiplied.
    pub range: [f64; 2],
}

impl NoiseLearning {
    /// Steps of .03; the factor is between 1/1000 and 1000.
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
