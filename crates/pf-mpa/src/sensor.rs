//! A node that measures its distance to the target, and the noise of that range.

use crate::Error;
use fewbits_core::columns::measurements_agree;
use fewbits_core::{Columns, ColumnsMut, OnAxes, RangeNoise, Sensing};
use fewbits_numerics::error::all_finite;
use fewbits_numerics::kernels::vectorised;
use nalgebra::{Matrix1, RowVector2, Vector1, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A range sensor at a fixed place: `z = |p - n| + v`, `v` of the given [`RangeNoise`]. Its state is a position of two coordinates. For
/// a larger state, [`RangeSensor::on_axes`] says which coordinates are the position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Place")]
pub struct RangeSensor {
    position: Vector2<f64>,
    noise: RangeNoise,
}

/// The stored form of [`RangeSensor`].
#[derive(Deserialize)]
#[serde(rename = "RangeSensor")]
#[serde(deny_unknown_fields)]
struct Place {
    position: Vector2<f64>,
    noise: RangeNoise,
}

impl TryFrom<Place> for RangeSensor {
    type Error = Error;

    fn try_from(parts: Place) -> Result<Self, Error> {
        RangeSensor::new(parts.position, parts.noise)
    }
}

impl RangeSensor {
    /// A sensor at `position`.
    ///
    /// # Errors
    /// If a coordinate is not finite.
    pub fn new(position: Vector2<f64>, noise: RangeNoise) -> Result<Self, Error> {
        all_finite("position", position.as_slice())?;
        Ok(Self { position, noise })
    }

    /// The same sensor in a state of `D` coordinates that has the position at `axes`: `[0, 2]` for `[x, vx, y, vy]`.
    ///
    /// ```
    /// use fewbits_core::Sensing;
    /// use fewbits_pf_mpa::{RangeNoise, RangeSensor};
    /// use nalgebra::{Vector2, Vector4};
    /// let sensor = RangeSensor::new(Vector2::zeros(), RangeNoise::constant(1.0)?)?;
    /// assert_eq!(sensor.mean(&Vector2::new(3.0, 4.0)).x, 5.0);
    /// let of_state = sensor.on_axes::<4>([0, 2])?;
    /// assert_eq!(of_state.mean(&Vector4::new(3.0, 0.5, 4.0, 0.5)).x, 5.0);
    /// # Ok::<(), fewbits_pf_mpa::Error>(())
    /// ```
    ///
    /// A state of four coordinates is no position: without axes the last line does not compile.
    ///
    /// ```compile_fail,E0308
    /// # use fewbits_core::Sensing;
    /// # use fewbits_pf_mpa::{RangeNoise, RangeSensor};
    /// # use nalgebra::{Vector2, Vector4};
    /// let sensor = RangeSensor::new(Vector2::zeros(), RangeNoise::constant(1.0)?)?;
    /// sensor.mean(&Vector4::new(3.0, 0.5, 4.0, 0.5));
    /// # Ok::<(), fewbits_pf_mpa::Error>(())
    /// ```
    ///
    /// # Errors
    /// If an axis is not below `D`, or both are equal.
    pub fn on_axes<const D: usize>(self, axes: [usize; 2]) -> Result<OnAxes<Self, D, 2>, Error> {
        Ok(OnAxes::new(self, axes)?)
    }

    /// Position of the sensor.
    pub fn position(&self) -> &Vector2<f64> {
        &self.position
    }

    /// Noise of the ranges.
    pub fn noise(&self) -> &RangeNoise {
        &self.noise
    }

    /// Distance from the sensor to the point `(x, y)`.
    #[inline]
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - self.position[0], y - self.position[1]);
        let squared = dx * dx + dy * dy;
        // The squares overflow or underflow.
        if !(1e-280..=1e280).contains(&squared) {
            libm::hypot(dx, dy)
        } else {
            squared.sqrt()
        }
    }

    /// Distances of many points. The loop has no branches; if a square overflows or underflows, all are computed again by `hypot`.
    fn distances(&self, x: &[f64], y: &[f64], distances: &mut [f64]) {
        let (sx, sy) = (self.position[0], self.position[1]);
        let count = distances.len();
        let (x, y) = (&x[..count], &y[..count]);
        // The square overflows or underflows only at extreme coordinates; then `hypot` is used for all.
        let sound = vectorised(
            #[inline(always)]
            || {
                let (mut least, mut most) = (f64::INFINITY, 0.0);
                for ((distance, x), y) in distances.iter_mut().zip(x).zip(y) {
                    let (dx, dy) = (x - sx, y - sy);
                    let squared = dx * dx + dy * dy;
                    least = if squared < least { squared } else { least };
                    most = if squared > most { squared } else { most };
                    *distance = squared.sqrt();
                }
                least >= 1e-280 && most <= 1e280
            },
        );
        if !sound {
            for ((distance, x), y) in distances.iter_mut().zip(x).zip(y) {
                *distance = self.distance(*x, *y);
            }
        }
    }

    /// Unit vector from the sensor to a point, the gradient of the distance; zero at the sensor itself, where there is none.
    pub fn direction(&self, x: f64, y: f64) -> Vector2<f64> {
        let distance = self.distance(x, y);
        if distance > f64::MAX {
            // A difference or its length overflows; a quarter of it does not.
            let (dx, dy) = (0.25 * x - 0.25 * self.position[0], 0.25 * y - 0.25 * self.position[1]);
            return Vector2::new(dx, dy) / libm::hypot(dx, dy);
        }
        if distance > 0.0 {
            (Vector2::new(x, y) - self.position) / distance
        } else {
            Vector2::zeros()
        }
    }

    /// Draws a measurement of the given distance.
    pub fn measure<R: Rng + ?Sized>(&self, rng: &mut R, distance: f64) -> f64 {
        let normal: f64 = rng.sample(StandardNormal);
        distance + self.noise.deviation(distance) * normal
    }
}

impl Sensing<2, 1> for RangeSensor {
    #[inline]
    fn mean(&self, place: &Vector2<f64>) -> Vector1<f64> {
        Vector1::new(self.distance(place[0], place[1]))
    }

    fn jacobian(&self, place: &Vector2<f64>) -> RowVector2<f64> {
        self.direction(place[0], place[1]).transpose()
    }

    fn noise_covariance_at(&self, place: &Vector2<f64>) -> Matrix1<f64> {
        let deviation = self.noise.deviation(self.distance(place[0], place[1]));
        Matrix1::new(deviation * deviation)
    }

    fn sample(&self, rng: &mut dyn Rng, place: &Vector2<f64>) -> Vector1<f64> {
        Vector1::new(self.measure(rng, self.distance(place[0], place[1])))
    }

    fn mean_columns(&self, places: &Columns<'_, 2>, [means]: ColumnsMut<'_, 1>) {
        if !measurements_agree(places, &mut [&mut *means]) {
            return;
        }
        self.distances(places[0], places[1], means);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::sensing;
    use nalgebra::Vector4;

    fn sensor(noise: RangeNoise) -> RangeSensor {
        RangeSensor::new(Vector2::new(1.0, -2.0), noise).unwrap()
    }

    #[test]
    fn sensors_obey_the_laws_of_sensing() {
        for noise in [
            RangeNoise::from_snr_db(30.0).unwrap(),
            RangeNoise::constant(0.4).unwrap(),
            RangeNoise::new(0.3, 0.1).unwrap(),
        ] {
            let at = Vector4::new(4.0, 9.0, 2.0, 9.0);
            let sensed = sensor(noise).on_axes::<4>([0, 2]).unwrap();
            assert_eq!(sensed.mean(&at)[0], 5.0);
            sensing::is_consistent(&sensed, &[at, Vector4::new(-3.0, 0.0, 7.0, 1.0)]).unwrap();
            let mut rng = fewbits_monte_carlo::Stream::new(3).rng();
            sensing::draws_have_the_law(&sensed, &mut rng, &at, 20_000).unwrap();
        }
    }

    #[test]
    fn noise_is_relative_to_the_range_and_slopes_are_derivatives() {
        let noise = RangeNoise::from_snr_db(30.0).unwrap();
        assert!((noise.deviation(5.0) - 5.0 / 1000.0_f64.sqrt()).abs() < 1e-15);
        assert!(noise.deviation(0.0) > 0.0 && noise.slope(0.0).is_finite());
        let both = RangeNoise::new(0.3, 0.1).unwrap();
        let numeric = (both.deviation(2.0 + 1e-6) - both.deviation(2.0 - 1e-6)) / 2e-6;
        assert!((both.slope(2.0) - numeric).abs() < 1e-9);
    }

    #[test]
    fn distances_survive_any_unit() {
        for scale in [1e-200, 1e-4, 1.0, 1e4, 1e200] {
            let sensor = RangeSensor::new(Vector2::zeros(), RangeNoise::from_snr_db(40.0).unwrap()).unwrap();
            assert!((sensor.distance(3.0 * scale, 4.0 * scale) / (5.0 * scale) - 1.0).abs() < 1e-15);
            assert!((sensor.direction(3.0 * scale, 4.0 * scale) - Vector2::new(0.6, 0.8)).amax() < 1e-15);
        }
        let far = RangeSensor::new(Vector2::new(-1.5e308, 0.0), RangeNoise::constant(1.0).unwrap()).unwrap();
        assert!((far.direction(1.5e308, 0.0) - Vector2::new(1.0, 0.0)).amax() < 1e-15);
    }
}
