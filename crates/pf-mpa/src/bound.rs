//! What no tracker can beat: Fisher information of a range, and the posterior Cramer-Rao recursion.

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

/// Fisher information about the distance `d` of a range itself: `(1 + 2 sigma'^2) / sigma^2`, `(c^2 + 2) / d^2` with the thesis's
/// noise. The second term is what the size of the noise says.
///
/// # Errors
/// If the distance is not above zero, or the information is no number.
pub fn range_information(noise: &RangeNoise, distance: f64) -> Result<f64, Error> {
    positive("distance", distance)?;
    let (sigma, slope) = (noise.deviation(distance), noise.slope(distance));
    information((1.0 + 2.0 * slope * slope) / (sigma * sigma))
}

fn information(value: f64) -> Result<f64, Error> {
    Ok(fewbits_numerics::error::non_negative("information", value)?)
}

/// Fisher information about the distance of the level of a quantized range: `sum_q (dP_q/dd)^2 / P_q`, the outer cells open.
///
/// Most of it is at the edges: the integral over one edge is `1.8063 / sigma`, so that its expectation grows without bound as the
/// noise falls, though the error that can be reached does not. At high signal-to-noise ratios the bound is loose.
///
/// # Errors
/// If the distance is not above zero, there are fewer than two levels, the reference is none, or the information is no number.
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

/// The posterior Cramer-Rao bound of `[x, y, vx, vy]`, step by step. The accelerations count as known: a bound for a filter that
/// knows less, and looser. Adding their variance to the process noise would be no bound.
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

    /// `J_k = (F J_{k-1}^-1 F' + G q G')^-1 + I`, held as `J^-1`. `information` is expected: [`position_information`], averaged over what is
    /// unknown.
    ///
    /// # Errors
    /// If a matrix is not positive semidefinite.
    pub fn step_with(&mut self, target: &Target, information: &Matrix4<f64>) -> Result<(), Error> {
        self.bound = cramer_rao::covariance_step(&target.dynamics(0.0)?, &self.bound, information)?;
        Ok(())
    }

    /// `J^-1`.
    pub fn covariance(&self) -> &Matrix4<f64> {
        &self.bound
    }

    /// Bound on `E (x - x^)^2 + (y - y^)^2`.
    pub fn position(&self) -> f64 {
        self.bound[(0, 0)] + self.bound[(1, 1)]
    }
}

/// Information of all sensors about a target at `place`: of levels where there are references, of ranges otherwise.
///
/// # Errors
/// If the target stands on a sensor.
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
