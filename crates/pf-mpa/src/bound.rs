//! Bounds on the error of any tracker: Fisher information of a range, and the posterior Cramer-Rao recursion.

use crate::Error;
use crate::factor::log_inside;
use crate::quantized::RangeReference;
use crate::sensor::{RangeNoise, RangeSensor};
use crate::target::Target;
use fewbits_filters::cramer_rao;
use fewbits_numerics::error::positive;
use fewbits_numerics::error::refuse;
use fewbits_numerics::normal;
use nalgebra::{Matrix4, Vector2};

/// Fisher information about the distance `d` of an unquantized range: `(1 + 2 sigma'^2) / sigma^2`, with the thesis's noise
/// `(c^2 + 2) / d^2`. The second term arises because the noise variance depends on the distance.
///
/// # Errors
/// If the distance is not positive, or the information is not finite.
pub fn range_information(noise: &RangeNoise, distance: f64) -> Result<f64, Error> {
    positive("distance", distance)?;
    let (sigma, slope) = (noise.deviation(distance), noise.slope(distance));
    information((1.0 + 2.0 * slope * slope) / (sigma * sigma))
}

fn information(value: f64) -> Result<f64, Error> {
    Ok(fewbits_numerics::error::non_negative("information", value)?)
}

/// Fisher information about the distance of a quantized range: `sum_q (dP_q/dd)^2 / P_q` over the levels. The outer cells are unbounded.
///
/// Most of it is near the edges of the cells: the integral over one edge is `1.8063 / sigma`. Its expectation therefore grows without
/// limit as the noise falls, but the attainable error does not vanish. At high signal-to-noise ratios the bound is loose.
///
/// # Errors
/// If the distance is not positive, there are fewer than two levels, the reference is not valid, or the information is not finite.
pub fn level_information(
    reference: &RangeReference,
    levels: usize,
    noise: &RangeNoise,
    distance: f64,
) -> Result<f64, Error> {
    positive("distance", distance)?;
    if levels < 2 {
        return refuse("levels", levels, "at least 2 levels");
    }
    let (sigma, slope) = (noise.deviation(distance), noise.slope(distance));
    // An edge, and the slope of Phi there.
    let at = |edge: f64| {
        let t = (edge - distance) / sigma;
        (edge, -normal::pdf(t) * (1.0 + t * slope) / sigma)
    };
    let mut sum = 0.0;
    let mut lower = (f64::NEG_INFINITY, 0.0);
    for q in 0..levels {
        let cell = reference.nominal_cell(q, levels)?;
        let upper = if q + 1 == levels {
            (f64::INFINITY, 0.0)
        } else {
            at(cell.upper())
        };
        let change: f64 = upper.1 - lower.1;
        if change != 0.0 {
            sum += (2.0 * change.abs().ln() - log_inside(lower.0, upper.0, distance, sigma)).exp();
        }
        lower = upper;
    }
    information(sum)
}

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
