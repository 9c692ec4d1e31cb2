//! Received signal strength in decibels.

use crate::Error;
use fewbits_core::Sensing;
use fewbits_numerics::error::{all_finite, finite, positive};
use nalgebra::{Matrix1, SMatrix, SVector, Vector1};
use std::f64::consts::LN_10;

/// The log-distance model of received power: `level - 10 exponent log10(d) + w` in dBm at distance `d`, with shadowing `w ~ N(0, deviation^2)` in
/// dB. RSSI of Bluetooth beacons, Wi-Fi, LoRa, cell towers.
///
/// `D` is the number of coordinates of a position. A state with more coordinates takes it through [`OnAxes`](fewbits_core::OnAxes). In free space
/// `exponent` is 2, indoors 1.6 to 4; shadowing is 3 to 8 dB and does not average out while transmitter and receiver rest.
///
/// ```
/// use fewbits_core::factor::Value;
/// use fewbits_core::{Gaussian, Likelihood, Observed};
/// use fewbits_models::LogDistance;
/// use nalgebra::{Matrix2, Vector2};
///
/// // Three beacons of -50 dBm at one metre, heard at -62, -66 and -71 dBm.
/// let beacons = [(0.0, 0.0, -62.0), (10.0, 0.0, -66.0), (5.0, 9.0, -71.0)];
/// let mut belief = Gaussian::new(Vector2::new(5.0, 4.0), Matrix2::identity() * 9.0)?;
/// for (x, y, heard) in beacons {
///     let beacon = LogDistance::new(Vector2::new(x, y), -50.0, 2.0, 4.0)?;
///     Observed::new(beacon, Value::scalar(heard, 16.0)?).condition(&mut belief)?;
/// }
/// assert!((belief.mean() - Vector2::new(3.9, 2.2)).norm() < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogDistance<const D: usize> {
    position: SVector<f64, D>,
    level: f64,
    exponent: f64,
    noise_variance: f64,
}

/// Shortest distance of the model, in units of the distance of `level`: at an antenna there is no such law.
const SHORTEST: f64 = 1e-3;

impl<const D: usize> LogDistance<D> {
    /// A transmitter (or receiver) at `position`, heard with `level` dBm at distance 1, of path-loss `exponent`, and shadowing of `deviation` dB.
    ///
    /// # Errors
    /// If a coordinate or the level is not finite, or exponent or deviation is not positive.
    pub fn new(position: SVector<f64, D>, level: f64, exponent: f64, deviation: f64) -> Result<Self, Error> {
        all_finite("position", position.as_slice())?;
        Ok(Self {
            position,
            level: finite("level", level)?,
            exponent: positive("exponent", exponent)?,
            noise_variance: positive("deviation", deviation)?.powi(2),
        })
    }

    /// The distance at which the level is heard without noise: `10^((level at 1 - heard) / (10 exponent))`.
    pub fn distance(&self, heard: f64) -> f64 {
        10.0_f64.powf((self.level - heard) / (10.0 * self.exponent))
    }

    fn squared_distance(&self, at: &SVector<f64, D>) -> f64 {
        (at - self.position).norm_squared()
    }

    /// Where a place is whose squared distance is beyond all numbers: a scale, and the difference from the position in that scale.
    fn far(&self, at: &SVector<f64, D>) -> (f64, SVector<f64, D>) {
        let half = at * 0.5 - self.position * 0.5;
        let scale = half.amax();
        (scale, half / scale * 2.0)
    }
}

impl<const D: usize> Sensing<D, 1> for LogDistance<D> {
    fn mean(&self, at: &SVector<f64, D>) -> Vector1<f64> {
        let squared = self.squared_distance(at).max(SHORTEST * SHORTEST);
        if squared == f64::INFINITY {
            let (scale, direction) = self.far(at);
            return Vector1::new(self.level - 10.0 * self.exponent * (scale.log10() + direction.norm().log10()));
        }
        Vector1::new(self.level - 5.0 * self.exponent * squared.log10())
    }

    fn jacobian(&self, at: &SVector<f64, D>) -> SMatrix<f64, 1, D> {
        let squared = self.squared_distance(at);
        if squared <= SHORTEST * SHORTEST {
            return SMatrix::zeros();
        }
        if squared == f64::INFINITY {
            let (scale, direction) = self.far(at);
            return direction.transpose() * (-10.0 * self.exponent / LN_10 / direction.norm_squared() / scale);
        }
        (at - self.position).transpose() * (-10.0 * self.exponent / LN_10 / squared)
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> Matrix1<f64> {
        Matrix1::new(self.noise_variance)
    }
}
