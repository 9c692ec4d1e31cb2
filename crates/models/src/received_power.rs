//! Measurement of a source's received amplitude, which decreases with distance.

use crate::Error;
use fewbits_core::columns::measurements_agree;
use fewbits_core::{Columns, ColumnsMut, Sensing};
use fewbits_numerics::error::{finite, positive, refuse};
use fewbits_numerics::kernels::vectorised;
use nalgebra::{Matrix1, SMatrix, SVector, Vector1, Vector2};
use serde::{Deserialize, Serialize};

/// `z = sqrt(P0 / (1 + alpha d^n)) + w`, `w ~ N(0, r)`, where `d` is the distance from the sensor to a source in the plane.
///
/// `D` is the dimension of the state and `axes` says which two coordinates are the position. `P0` is the power at distance
/// zero (measurement units squared), `alpha` is in distance units to the power `-n`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parameters<D>", into = "Parameters<D>")]
pub struct ReceivedPower<const D: usize> {
    position: Vector2<f64>,
    axes: [usize; 2],
    power: f64,
    attenuation: f64,
    exponent: f64,
    noise_covariance: Matrix1<f64>,
}

/// The stored form of [`ReceivedPower`].
#[derive(Serialize, Deserialize)]
#[serde(rename = "ReceivedPower")]
#[serde(deny_unknown_fields)]
struct Parameters<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    position: Vector2<f64>,
    axes: [usize; 2],
    power: f64,
    attenuation: f64,
    exponent: f64,
    noise_variance: f64,
}

impl<const D: usize> From<ReceivedPower<D>> for Parameters<D> {
    fn from(sensor: ReceivedPower<D>) -> Self {
        Self {
            position: sensor.position,
            axes: sensor.axes,
            power: sensor.power,
            attenuation: sensor.attenuation,
            exponent: sensor.exponent,
            noise_variance: sensor.noise_variance(),
        }
    }
}

impl<const D: usize> TryFrom<Parameters<D>> for ReceivedPower<D> {
    type Error = Error;

    fn try_from(parts: Parameters<D>) -> Result<Self, Error> {
        ReceivedPower::new(
            parts.position,
            parts.axes,
            parts.power,
            parts.attenuation,
            parts.exponent,
            parts.noise_variance,
        )
    }
}

impl<const D: usize> ReceivedPower<D> {
    /// The sensor at `position` that senses the source at `(x[axes[0]], x[axes[1]])`.
    ///
    /// # Errors
    /// If a number is not finite; power, attenuation or noise variance is not positive; the exponent is below 1, for which the slope
    /// is infinite at the sensor; or the axes are equal or not below `D`.
    pub fn new(
        position: Vector2<f64>,
        axes: [usize; 2],
        power: f64,
        attenuation: f64,
        exponent: f64,
        noise_variance: f64,
    ) -> Result<Self, Error> {
        finite("position", position[0])?;
        finite("position", position[1])?;
        if axes[0] == axes[1] || axes.iter().any(|a| *a >= D) {
            return refuse("axes", format!("{axes:?}"), format!("two different axes below {D}"));
        }
        positive("exponent", exponent)?;
        if exponent < 1.0 {
            return refuse("exponent", exponent, "a number of at least 1");
        }
        Ok(Self {
            position,
            axes,
            power: positive("power", power)?,
            attenuation: positive("attenuation", attenuation)?,
            exponent,
            noise_covariance: Matrix1::new(positive("noise_variance", noise_variance)?),
        })
    }

    /// Position of the sensor.
    pub fn position(&self) -> Vector2<f64> {
        self.position
    }

    /// Noise variance `r`.
    pub fn noise_variance(&self) -> f64 {
        self.noise_covariance[0]
    }

    /// The amplitude as a function of the squared distance `d^2`.
    #[inline]
    fn amplitude(&self, squared_distance: f64) -> f64 {
        let spread = squared_distance.powf(0.5 * self.exponent);
        (self.power / (1.0 + self.attenuation * spread)).sqrt()
    }

    /// Noise-free amplitude of a source at `(x, y)`.
    fn amplitude_at(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - self.position[0], y - self.position[1]);
        self.amplitude(dx * dx + dy * dy)
    }

    /// Gradient `(dh/dx, dh/dy)` of the amplitude at `(x, y)`: `c (x - sx)`, `c (y - sy)` with
    /// `c = -(1/2) sqrt(P0) alpha n d^(n-2) (1 + alpha d^n)^(-3/2)`.
    ///
    /// At the sensor itself the gradient is zero for `n > 1`. For `n = 1` it has no limit there, and zero is returned.
    fn slope_at(&self, x: f64, y: f64) -> Vector2<f64> {
        let offset = Vector2::new(x, y) - self.position;
        let distance = offset[0].hypot(offset[1]);
        // If the squared distance overflows, the slope is zero.
        if distance == 0.0 || distance == f64::INFINITY {
            return Vector2::zeros();
        }
        // `-(n/2) h(d) u/d` with `u = alpha d^n / (1 + alpha d^n)`, which is bounded: `d^n` may overflow.
        let spread = self.attenuation * distance.powf(self.exponent);
        let share = if spread == f64::INFINITY {
            1.0
        } else {
            spread / (1.0 + spread)
        };
        let amplitude = (self.power / (1.0 + spread)).sqrt();
        let steepness = 0.5 * self.exponent * amplitude * (share / distance);
        if steepness.is_finite() {
            return offset / distance * -steepness;
        }
        // Logarithms are needed only for the product of a huge and a tiny number.
        let log = (0.5 * self.exponent).ln() + amplitude.ln() + share.ln() - distance.ln();
        offset / distance * -log.exp().min(f64::MAX)
    }
}

impl<const D: usize> Sensing<D, 1> for ReceivedPower<D> {
    fn mean(&self, state: &SVector<f64, D>) -> Vector1<f64> {
        Vector1::new(self.amplitude_at(state[self.axes[0]], state[self.axes[1]]))
    }

    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, 1, D> {
        let slope = self.slope_at(state[self.axes[0]], state[self.axes[1]]);
        let mut row = SMatrix::zeros();
        row[self.axes[0]] = slope[0];
        row[self.axes[1]] = slope[1];
        row
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> Matrix1<f64> {
        self.noise_covariance
    }

    fn mean_columns(&self, states: &Columns<'_, D>, mut means: ColumnsMut<'_, 1>) {
        if !measurements_agree(states, &mut means) {
            return;
        }
        let [amplitudes] = means;
        let count = amplitudes.len();
        let (x, y) = (&states[self.axes[0]][..count], &states[self.axes[1]][..count]);
        let (sx, sy) = (self.position[0], self.position[1]);
        let squared = |i: usize| {
            let (dx, dy) = (x[i] - sx, y[i] - sy);
            dx * dx + dy * dy
        };
        // For n = 2 no power function is needed, and the loop vectorises.
        if self.exponent == 2.0 {
            vectorised(
                #[inline(always)]
                || {
                    for (i, amplitude) in amplitudes.iter_mut().enumerate() {
                        *amplitude = (self.power / (1.0 + self.attenuation * squared(i))).sqrt();
                    }
                },
            );
        } else {
            for (i, amplitude) in amplitudes.iter_mut().enumerate() {
                *amplitude = self.amplitude(squared(i));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ReceivedPower;
    use nalgebra::Vector2;

    #[test]
    fn the_slope_at_the_sensor_is_zero() {
        for exponent in [1.0, 1.2, 2.0] {
            let sensor = ReceivedPower::<4>::new(Vector2::zeros(), [0, 2], 1000.0, 1.0, exponent, 1.0).unwrap();
            assert_eq!(sensor.slope_at(0.0, 0.0), Vector2::zeros());
            assert!(sensor.slope_at(1e-200, 0.0)[0].is_finite());
        }
    }

    /// Defect: with an exponent of 4 the slope at a distance of 1e103 was `0 * inf`.
    #[test]
    fn slopes_far_away_are_numbers() {
        for exponent in [1.0, 2.0, 4.0, 300.0] {
            let sensor = ReceivedPower::<4>::new(Vector2::zeros(), [0, 2], 1000.0, 1.0, exponent, 1.0).unwrap();
            for d in [1e-300, 1e-3, 1.0, 1e3, 1e103, 1e300] {
                let slope = sensor.slope_at(d, 0.0);
                assert!(slope[0].is_finite() && slope[0] <= 0.0 && slope[1] == 0.0, "{exponent} {d}: {slope}");
            }
        }
        // Far away h = sqrt(P0 / alpha) d^(-n/2).
        let sensor = ReceivedPower::<4>::new(Vector2::zeros(), [0, 2], 9.0, 1.0, 4.0, 1.0).unwrap();
        assert!((sensor.slope_at(1e60, 0.0)[0] / (-6.0e-180) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn bad_parameters_are_refused() {
        let new = |axes, power, alpha, n, r| ReceivedPower::<4>::new(Vector2::zeros(), axes, power, alpha, n, r);
        assert!(new([0, 2], 1.0, 1.0, 2.0, 1.0).is_ok());
        assert!(new([0, 0], 1.0, 1.0, 2.0, 1.0).is_err());
        assert!(new([0, 4], 1.0, 1.0, 2.0, 1.0).is_err());
        for (power, alpha, n, r) in [
            (0.0, 1.0, 2.0, 1.0),
            (1.0, -1.0, 2.0, 1.0),
            (1.0, 1.0, 0.9, 1.0),
            (1.0, 1.0, 2.0, 0.0),
            (1.0, 1.0, f64::NAN, 1.0),
        ] {
            assert!(new([0, 2], power, alpha, n, r).is_err());
        }
        assert!(ReceivedPower::<4>::new(Vector2::new(f64::INFINITY, 0.0), [0, 2], 1.0, 1.0, 2.0, 1.0).is_err());
    }
}
