//! What is known of the ranges before the first one.

use crate::Error;
use fewbits_models::ContinuousLinear;
use fewbits_numerics::error::{positive, within};
use nalgebra::{SMatrix, SVector};

/// What is known of the ranges before the first one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeSettings {
    /// Deviation of a range's error, in metres. Errors of neighbouring ranges are alike, so take it above their spread.
    pub noise: f64,
    /// Share of ranges that have nothing to do with the distance, and the width of where they lie, in metres.
    pub outliers: f64,
    /// See `outliers`.
    pub stray: f64,
    /// Deviation of the velocity along each axis, in metres per second.
    pub speed: f64,
    /// How well `speed` is known: to this factor, 1 or more. The speed is learnt within it, by a [`NoiseBank`](fewbits_filters::NoiseBank) of
    /// speeds from `speed / speed_factor` to `speed * speed_factor`, each at most twice the one before. At `v` times `speed` the
    /// process noise has `v^2` times its covariance, the drift of the bias included.
    pub speed_factor: f64,
    /// How long a velocity lasts, in seconds.
    pub persistence: f64,
    /// Deviation of the bias before the first range, in metres, and the growth of its variance, in square metres per second.
    pub bias: f64,
    /// See `bias`.
    pub drift: f64,
    /// Seconds without a range after which the position is looked for anew.
    pub silence: f64,
}

impl Default for RangeSettings {
    /// Radios of a metre's error on something that walks or drives slowly.
    fn default() -> Self {
        Self {
            noise: 1.8,
            outliers: 0.02,
            stray: 40.0,
            speed: 1.0,
            speed_factor: 4.0,
            persistence: 6.0,
            bias: 5.0,
            drift: 1e-4,
            silence: 30.0,
        }
    }
}

impl RangeSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        within("outliers", self.outliers, 0.0, 0.5)?;
        within("speed_factor", self.speed_factor, 1.0, 1e3)?;
        for (name, value) in [
            ("noise", self.noise),
            ("stray", self.stray),
            ("speed", self.speed),
            ("persistence", self.persistence),
            ("bias", self.bias),
            ("drift", self.drift),
            ("silence", self.silence),
        ] {
            positive(name, value)?;
        }
        Ok(())
    }

    /// Scales of the process noise's covariance in the bank, the squares of those of the speed: steps of at most two in speed, which cost a few
    /// percent of the error.
    pub(super) fn scales(&self) -> Vec<f64> {
        let steps = self.speed_factor.log2().ceil() as i32;
        let step = if steps > 0 {
            2.0 * self.speed_factor.ln() / f64::from(steps)
        } else {
            0.0
        };
        (-steps..=steps).map(|i| (step * f64::from(i)).exp()).collect()
    }

    /// `[x, vx, y, vy, bias]`.
    pub(super) fn world(&self) -> Result<ContinuousLinear<5>, Error> {
        let (rate, speed) = (1.0 / self.persistence, self.speed);
        let (mut drift, mut density) = (SMatrix::<f64, 5, 5>::zeros(), SMatrix::<f64, 5, 5>::zeros());
        for position in [0, 2] {
            drift[(position, position + 1)] = 1.0;
            drift[(position + 1, position + 1)] = -rate;
            density[(position + 1, position + 1)] = 2.0 * rate * speed * speed;
        }
        density[(4, 4)] = self.drift;
        ContinuousLinear::new(drift, SVector::zeros(), density)
    }
}
