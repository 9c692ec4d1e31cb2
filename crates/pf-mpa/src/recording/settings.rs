//! Settings of the range tracker.

use crate::Error;
use fewbits_models::ContinuousLinear;
use fewbits_numerics::error::{positive, within};
use nalgebra::{SMatrix, SVector};

/// Indices of bias and scale in the state.
pub(super) const BIAS: usize = 4;
pub(super) const SCALE: usize = 5;
/// Index of the sum of the bias and the error of the next range.
pub(super) const OFFSET: usize = 6;
/// Probability per range that the speed changes: once in a few minutes. The noise is a property of the radio and changes less often.
const SPEED_CHANGES: f64 = 0.003;
const NOISE_CHANGES: f64 = 0.1 * SPEED_CHANGES;

/// What is assumed about ranges and target before the first range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeSettings {
    /// Largest standard deviation of a range's error, in metres, without bias and error of scale.
    pub noise: f64,
    /// Uncertainty of `noise` as a factor, 1 or more. The tracker estimates the deviation from `noise / noise_factor` to `noise`, as it
    /// estimates the speed. It does not consider larger deviations, because they would explain a lost track. Errors that last for seconds
    /// make the estimate too small: with 1 the deviation is `noise`.
    pub noise_factor: f64,
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
    /// Standard deviation of the error of scale before the first range: ranges are `1 + scale` times the distance. It is constant.
    pub scale: f64,
    /// Seconds without a range after which acquisition starts again.
    pub silence: f64,
}

impl Default for RangeSettings {
    /// For radios with an error of about a metre on a target that walks or drives slowly.
    fn default() -> Self {
        Self {
            noise: 1.8,
            noise_factor: 4.0,
            outliers: 0.02,
            stray: 40.0,
            speed: 1.0,
            speed_factor: 4.0,
            persistence: 6.0,
            bias: 5.0,
            drift: 1e-4,
            scale: 0.1,
            silence: 30.0,
        }
    }
}

impl RangeSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        within("outliers", self.outliers, 0.0, 0.5)?;
        within("speed_factor", self.speed_factor, 1.0, 1e3)?;
        within("noise_factor", self.noise_factor, 1.0, 1e3)?;
        for (name, value) in [
            ("noise", self.noise),
            ("stray", self.stray),
            ("speed", self.speed),
            ("persistence", self.persistence),
            ("bias", self.bias),
            ("drift", self.drift),
            ("scale", self.scale),
            ("silence", self.silence),
        ] {
            positive(name, value)?;
        }
        Ok(())
    }

    /// Standard deviations of bias and scale before the first range.
    pub(super) fn calibration(&self) -> [f64; 2] {
        [self.bias, self.scale]
    }

    /// The filters of the bank, each with its factor of the speed and its factor of the noise, and the transition probabilities between
    /// them. Speed and noise change independently.
    pub(super) fn bank(&self) -> (Vec<(f64, f64)>, Vec<Vec<f64>>) {
        let (speed, noise) = (self.speed_factor.log2(), self.noise_factor.log2());
        let (speeds, noises) = (steps(-speed, speed), steps(-noise, 0.0));
        let with_noises = |v: &f64| noises.iter().map(|r| (*v, *r)).collect::<Vec<_>>();
        let pairs: Vec<(f64, f64)> = speeds.iter().flat_map(with_noises).collect();
        // With probability `changes` the next value is drawn evenly from all, the present one included.
        let share = |same: bool, changes: f64, count: usize| changes / count as f64 + f64::from(same) * (1.0 - changes);
        let row = |(v, r): &(f64, f64)| {
            let to = |(to_v, to_r): &(f64, f64)| {
                share(v == to_v, SPEED_CHANGES, speeds.len()) * share(r == to_r, NOISE_CHANGES, noises.len())
            };
            pairs.iter().map(to).collect()
        };
        let transition = pairs.iter().map(row).collect();
        (pairs, transition)
    }

    /// The smallest noise of the bank, in metres.
    pub(super) fn least_noise(&self) -> f64 {
        self.noise / self.noise_factor
    }

    /// Dynamics of the state `[x, vx, y, vy, bias, scale, offset]`.
    pub(super) fn world(&self) -> Result<ContinuousLinear<7>, Error> {
        let (rate, speed) = (1.0 / self.persistence, self.speed);
        let (mut drift, mut density) = (SMatrix::<f64, 7, 7>::zeros(), SMatrix::<f64, 7, 7>::zeros());
        for position in [0, 2] {
            drift[(position, position + 1)] = 1.0;
            drift[(position + 1, position + 1)] = -rate;
            density[(position + 1, position + 1)] = 2.0 * rate * speed * speed;
        }
        density[(BIAS, BIAS)] = self.drift;
        ContinuousLinear::new(drift, SVector::zeros(), density)
    }
}

/// Factors from `2^from` to `2^to` in even steps, each at most twice the one before, which raises the error by a few percent.
fn steps(from: f64, to: f64) -> Vec<f64> {
    let count = (to - from).ceil().max(1.0);
    let exponent = |i: i32| from + (to - from) * f64::from(i) / count;
    let distinct = if to > from { count as i32 } else { 0 };
    (0..=distinct).map(|i| exponent(i).exp2()).collect()
}
