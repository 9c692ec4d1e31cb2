//! Targets of nearly constant velocity: the acceleration is white noise.

use crate::{Error, LinearGaussian};
use fewbits_numerics::error::{non_negative, positive};
use nalgebra::{Matrix2, Matrix4, Matrix4x2, SVector, Vector2};

/// A target on a line with state `[position, velocity]`: `x(n) = F x(n-1) + G u(n)` with `F = [[1, T], [0, 1]]`, `G = [T^2/2, T]'` and
/// acceleration `u` of variance `acceleration_variance`, constant within a step of length `T = interval`.
///
/// `interval` is in seconds. Positions may be in any unit of length; the variance is in that unit squared per second to the fourth power.
///
/// # Errors
/// If the interval is not positive, or the variance is negative.
pub fn constant_velocity_1d(interval: f64, acceleration_variance: f64) -> Result<LinearGaussian<2, 1>, Error> {
    let (transition, gain) = axis(interval)?;
    let variance = non_negative("acceleration_variance", acceleration_variance)?;
    LinearGaussian::new(transition, gain, SVector::repeat(variance))
}

/// A target in a plane with state `[x, x velocity, y, y velocity]`. Each axis is as in [`constant_velocity_1d`]; the accelerations of the
/// two axes are independent and of the same variance.
///
/// # Errors
/// As [`constant_velocity_1d`].
pub fn constant_velocity_2d(interval: f64, acceleration_variance: f64) -> Result<LinearGaussian<4, 2>, Error> {
    let (axis_transition, axis_gain) = axis(interval)?;
    let variance = non_negative("acceleration_variance", acceleration_variance)?;
    let mut transition = Matrix4::zeros();
    let mut gain = Matrix4x2::zeros();
    for (block, row) in [0, 2].into_iter().enumerate() {
        transition.fixed_view_mut::<2, 2>(row, row).copy_from(&axis_transition);
        gain.fixed_view_mut::<2, 1>(row, block).copy_from(&axis_gain);
    }
    LinearGaussian::new(transition, gain, SVector::repeat(variance))
}

/// `F` and `G` of one axis for a step of length `interval`.
fn axis(interval: f64) -> Result<(Matrix2<f64>, Vector2<f64>), Error> {
    let interval = positive("interval", interval)?;
    Ok((Matrix2::new(1.0, interval, 0.0, 1.0), Vector2::new(0.5 * interval * interval, interval)))
}

#[cfg(test)]
mod tests {
    use super::{constant_velocity_1d, constant_velocity_2d};
    use fewbits_core::{Dynamics, LinearDynamics};
    use nalgebra::{Matrix2, Vector4};

    #[test]
    fn noise_has_one_cause_an_axis() {
        let line = constant_velocity_1d(2.0, 3.0).unwrap();
        assert!((line.noise_covariance() - Matrix2::new(4.0, 4.0, 4.0, 4.0) * 3.0).amax() < 1e-12);
        let plane = constant_velocity_2d(2.0, 3.0).unwrap();
        assert_eq!(plane.noise_covariance().fixed_view::<2, 2>(2, 2), *line.noise_covariance());
        assert_eq!(plane.noise_covariance().fixed_view::<2, 2>(0, 2), Matrix2::zeros());
        let moved = plane.mean(&Vector4::new(1.0, 10.0, 5.0, -1.0));
        assert_eq!(moved, Vector4::new(21.0, 10.0, 3.0, -1.0));
    }

    #[test]
    fn refuses_bad_arguments() {
        for (interval, variance) in [(0.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            assert!(constant_velocity_1d(interval, variance).is_err());
            assert!(constant_velocity_2d(interval, variance).is_err());
        }
    }
}
