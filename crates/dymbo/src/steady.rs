//! Steady-state variances of several sign bits per slot.

use crate::plant::filtered_variance;
use crate::{Error, ScalarPlant};
use fewbits_core::Link;
use fewbits_filters::ScalarSteadyState;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::roots::bracketed;
use std::f64::consts::FRAC_2_PI;

/// The fixed point of a variance recursion. `slot` maps a predicted variance to the filtered one. It must be increasing and concave, and
/// remove at least as much variance as one sign bit through the link.
///
/// # Errors
/// If the plant is unstable, or the recursion has no finite fixed point.
pub(crate) fn settle(plant: &ScalarPlant, link: &Link, slot: impl Fn(f64) -> f64) -> Result<ScalarSteadyState, Error> {
    plant.refuse_unstable()?;
    let one_bit = plant
        .steady_state(crate::sign_bit::information(link))?
        .predicted_variance;
    let change = |p: f64| p - plant.dynamics().predict_variance(slot(p));
    // The recursion falls from one bit's fixed point to its own, and never below the process noise.
    let (low, high) = (plant.process_variance(), one_bit * (1.0 + 1e-9));
    let predicted_variance = if change(low) > 0.0 || change(high) < 0.0 {
        one_bit
    } else {
        bracketed(change, low, high, 0.0)?
    };
    Ok(ScalarSteadyState {
        predicted_variance,
        filtered_variance: slot(predicted_variance),
    })
}

/// Steady state with `sensors >= 1` sign bits per slot. The threshold is refreshed after each bit.
///
/// # Errors
/// If there is no sensor, or the plant is unstable.
pub fn sequential_steady_state(plant: &ScalarPlant, sensors: usize) -> Result<ScalarSteadyState, Error> {
    at_least_one("sensors", sensors)?;
    let r = plant.measurement_variance();
    settle(plant, &Link::PERFECT, |p| (0..sensors).fold(p, |p, _| filtered_variance(p, r, FRAC_2_PI)))
}

#[cfg(test)]
mod tests {
    use super::sequential_steady_state;
    use crate::{Error, ScalarPlant};

    #[test]
    fn bits_in_a_row_settle_where_the_recursion_does() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let one = sequential_steady_state(&plant, 1).unwrap().filtered_variance;
        let known = plant
            .steady_state(std::f64::consts::FRAC_2_PI)
            .unwrap()
            .filtered_variance;
        assert!((one - known).abs() < 1e-13);
        assert!(sequential_steady_state(&plant, 0).is_err());
        let wild = ScalarPlant::new_unstable(-3.0, 0.5, 1.0).unwrap();
        assert!(matches!(sequential_steady_state(&wild, 3), Err(Error::Argument(e)) if e.value == "-3"));
        // The fixed point of five steps in a row, found by walking to it.
        let mut m = 1.0;
        for _ in 0..500 {
            m = (0..5).fold(plant.dynamics().predict_variance(m), |p, _| {
                crate::filtered_variance(p, 1.0, std::f64::consts::FRAC_2_PI)
            });
        }
        assert!((sequential_steady_state(&plant, 5).unwrap().filtered_variance - m).abs() < 1e-14);
    }
}
