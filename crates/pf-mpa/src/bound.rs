//! Fisher information of a range and of its level.

use crate::Error;
use crate::quantized::RangeReference;
use fewbits_core::{Cell, RangeNoise};
use fewbits_numerics::error::positive;
use fewbits_numerics::error::refuse;
use fewbits_numerics::normal;

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
            let inside = Cell::new(lower.0, upper.0)?.log_probability(distance, sigma);
            sum += (2.0 * change.abs().ln() - inside).exp();
        }
        lower = upper;
    }
    information(sum)
}
