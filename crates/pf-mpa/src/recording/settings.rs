//! Settings of the range tracker.

use crate::Error;
use fewbits_models::ContinuousLinear;
use fewbits_numerics::error::{positive, within};
use nalgebra::{SMatrix, SVector};

/// What is assumed about ranges and target before the first range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeSettings {
    /// Standard deviation of a range's error, in metres. Errors of successive ranges are correlated, so use more than their spread.
    pub noise: f64,
    /// Share of outliers: ranges that do not depend on the distance.
    pub outliers: f64,
    /// Width of the interval over which outliers are spread, in metres.
    pub stray: f64,
    /// Standard deviation of the velocity along each axis, in metres per second.
    pub speed: f64,
    /// Uncertainty of `speed` as a factor, 1 or more. The tracker estimates the speed within it, by a
    /// [`NoiseBank`](fewbits_filters::NoiseBank) of speeds from `speed / speed_factor` to `speed * speed_factor`, each at most twice
    /// the one before. At `v` times `speed` the covariance of the process noise, with the drift of the bias, is multiplied by `v^2`.
    pub speed_factor: f64,
    /// Correlation time of the velocity, in seconds.
    pub persistence: f64,
    /// Standard deviation of the bias before the first range, in metres.
    pub bias: f64,
    /// Growth of the variance of the bias, in square metres per second.
    pub drift: f64,
    /// Seconds without a range after which acquisition starts again.
    pub silence: f64,
}

impl Default for RangeSettings {
    /// For radios with an error of about a metre on a target that walks or drives slowly.
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

    /// Factors of the process noise's covariance in the bank, the squares of the factors of the speed. Speeds differ by a factor of at most
    /// two, which raises the error by a few percent.
    pub(super) fn scales(&self) -> Vec<f64> {
        let steps = self.speed_factor.log2().ceil() as i32;
        let step = if steps > 0 {
            2.0 * self.speed_factor.ln() / f64::from(steps)
        } else {
            0.0
        };
        (-steps..=steps).map(|i| (step * f64::from(i)).exp()).collect()
    }

    /// Dynamics of the state `[x, vx, y, vy, bias]`.
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
