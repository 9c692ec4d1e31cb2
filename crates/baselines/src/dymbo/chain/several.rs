//! Steady-state variances of several sign bits per slot.

use fewbits_core::Link;
use fewbits_dymbo::{Error, ScalarPlant, filtered_variance};
use fewbits_filters::ScalarSteadyState;
use fewbits_models::Ar1;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::roots::bracketed;
use std::f64::consts::FRAC_2_PI;

/// Refuses a plant that corrections of bounded size cannot hold.
///
/// # Errors
/// If `|a| > 1`: an error beyond `gain / (|a| - 1)` then grows for ever, although the computed variance stays finite.
pub(super) fn refuse_unstable(plant: &ScalarPlant) -> Result<(), Error> {
    Ar1::new(plant.coefficient(), plant.process_variance()).map(drop)
}

/// The fixed point of a variance recursion. `slot` maps a predicted variance to the filtered one. It must be increasing and concave, and
/// remove at least as much variance as one sign bit through the link.
///
/// # Errors
/// If the plant is unstable, or the recursion has no finite fixed point.
pub(super) fn settle(plant: &ScalarPlant, link: &Link, slot: impl Fn(f64) -> f64) -> Result<ScalarSteadyState, Error> {
    refuse_unstable(plant)?;
    let one_bit = plant
        .steady_state(fewbits_dymbo::sign_bit::information(link))?
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
    use fewbits_dymbo::{Error, ScalarPlant};

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
                fewbits_dymbo::filtered_variance(p, 1.0, std::f64::consts::FRAC_2_PI)
            });
        }
        assert!((sequential_steady_state(&plant, 5).unwrap().filtered_variance - m).abs() < 1e-14);
    }
}
