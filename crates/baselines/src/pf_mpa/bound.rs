//! The posterior Cramer-Rao recursion of the printed target.

use crate::pf_mpa::target::Target;
use fewbits_filters::cramer_rao;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::{Error, RangeReference, RangeSensor, level_information, range_information};
use nalgebra::{Matrix4, Vector2};

/// The posterior Cramer-Rao bound of `[x, y, vx, vy]`, step by step. The accelerations are taken as known, so it is a valid but looser
/// bound for a filter that does not know them. Adding their variance to the process noise would not give a bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CramerRao {
    bound: Matrix4<f64>,
}

impl CramerRao {
    /// The bound before the first step: the prior's covariance.
    pub fn new(prior_covariance: Matrix4<f64>) -> Self {
        Self {
            bound: prior_covariance,
        }
    }

    /// `J_k = (F J_{k-1}^-1 F' + G q G')^-1 + I`; `J^-1` is stored. `information` is the expected `I`: the average of
    /// [`position_information`] over the unknown states.
    ///
    /// # Errors
    /// If a matrix is not positive semidefinite.
    pub fn step_with(&mut self, target: &Target, information: &Matrix4<f64>) -> Result<(), Error> {
        self.bound = cramer_rao::covariance_step(&target.dynamics(0.0)?, &self.bound, information)?;
        Ok(())
    }

    /// The bound `J^-1` on the covariance of `[x, y, vx, vy]`.
    pub fn covariance(&self) -> &Matrix4<f64> {
        &self.bound
    }

    /// Bound on `E (x - x^)^2 + (y - y^)^2`.
    pub fn position(&self) -> f64 {
        self.bound[(0, 0)] + self.bound[(1, 1)]
    }
}

/// Sum of the sensors' information about a target at `place`. `quantizer`: one reference per sensor and the number of levels; `None` for
/// unquantized ranges.
///
/// # Errors
/// If the target is at the place of a sensor.
pub fn position_information(
    sensors: &[RangeSensor],
    place: &Vector2<f64>,
    quantizer: Option<(&[RangeReference], usize)>,
) -> Result<Matrix4<f64>, Error> {
    let mut total = Matrix4::zeros();
    for (i, sensor) in sensors.iter().enumerate() {
        let (d, u) = (sensor.distance(place[0], place[1]), sensor.direction(place[0], place[1]));
        let own = match quantizer {
            Some((references, levels)) => match references.get(i) {
                Some(reference) => level_information(reference, levels, sensor.noise(), d)?,
                None => return refuse("references", references.len(), format!("{}, one per sensor", sensors.len())),
            },
            None => range_information(sensor.noise(), d)?,
        };
        let mut block = total.fixed_view_mut::<2, 2>(0, 0);
        block += u * u.transpose() * own;
    }
    Ok(total)
}
