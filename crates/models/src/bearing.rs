//! The direction in which a sensor sees a target.

use crate::Error;
use fewbits_core::Sensing;
use fewbits_numerics::error::{all_finite, positive};
use nalgebra::{Matrix1, RowVector2, Vector1, Vector2};
use std::f64::consts::TAU;

/// The direction from a sensor to a target in the plane, in Gaussian noise. It is periodic, so that residuals go the shorter way around.
///
/// In radians, counterclockwise from the first axis, or ([`in_degrees_from_north`](Self::in_degrees_from_north)) as a compass says it. A state
/// with more coordinates than the position takes it through [`OnAxes`](fewbits_core::OnAxes).
///
/// ```
/// use fewbits_core::factor::Value;
/// use fewbits_core::{Gaussian, Likelihood, Observed, OnAxes, Sensing};
/// use fewbits_models::Bearing;
/// use nalgebra::{Matrix4, Vector2, Vector4};
///
/// // A target west of the sensor, a little north of what is believed: the bearing crosses from pi to -pi.
/// let sensor = OnAxes::new(Bearing::new(Vector2::zeros(), 0.01)?, [0, 2])?;
/// let mut belief = Gaussian::new(Vector4::new(-10.0, 0.0, -0.5, 0.0), Matrix4::identity())?; // x, vx, y, vy
/// let z = Value::scalar(3.1, 0.01)?;
/// Observed::new(sensor, z).condition(&mut belief)?;
/// assert!((belief.mean()[2] + 0.04).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bearing {
    position: Vector2<f64>,
    noise_variance: f64,
    is_compass: bool,
}

impl Bearing {
    /// A sensor at `position`, with noise of this variance (radians squared).
    ///
    /// # Errors
    /// If a coordinate is not finite, or the variance is not positive.
    pub fn new(position: Vector2<f64>, noise_variance: f64) -> Result<Self, Error> {
        all_finite("position", position.as_slice())?;
        let noise_variance = positive("noise_variance", noise_variance)?;
        Ok(Self {
            position,
            noise_variance,
            is_compass: false,
        })
    }

    /// The same sensor whose bearings, and the noise's variance, are in degrees clockwise from north, with the axes east and north.
    #[must_use]
    pub fn in_degrees_from_north(self) -> Self {
        Self {
            is_compass: true,
            ..self
        }
    }

    /// Length of a turn: `2 pi`, or 360.
    fn turn(&self) -> f64 {
        if self.is_compass { 360.0 } else { TAU }
    }
}

impl Bearing {
    /// The way to a target, or half of it where the whole is beyond all numbers.
    fn way(&self, at: &Vector2<f64>) -> Vector2<f64> {
        let way = at - self.position;
        if way.amax() < f64::INFINITY {
            way
        } else {
            at * 0.5 - self.position * 0.5
        }
    }
}

impl Sensing<2, 1> for Bearing {
    fn mean(&self, at: &Vector2<f64>) -> Vector1<f64> {
        let d = self.way(at);
        Vector1::new(if self.is_compass {
            d[0].atan2(d[1]).to_degrees().rem_euclid(360.0)
        } else {
            d[1].atan2(d[0])
        })
    }

    /// Zero at the sensor itself, where there is none.
    fn jacobian(&self, at: &Vector2<f64>) -> RowVector2<f64> {
        let d = self.way(at);
        let norm = d.norm();
        // Squares may be beyond all numbers, or vanish.
        let distance = if norm.is_normal() { norm } else { d[0].hypot(d[1]) };
        if distance == 0.0 {
            return RowVector2::zeros();
        }
        let slope = RowVector2::new(-d[1] / distance, d[0] / distance) / distance;
        let per_radian = self.turn() / TAU;
        slope * if self.is_compass { -per_radian } else { per_radian }
    }

    fn noise_covariance_at(&self, _: &Vector2<f64>) -> Matrix1<f64> {
        Matrix1::new(self.noise_variance)
    }

    fn periods(&self) -> [Option<f64>; 1] {
        [Some(self.turn())]
    }
}
