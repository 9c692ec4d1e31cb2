//! Contours of the loss against the Kalman filter, and steady-state variances of several bits per slot.

use fewbits_core::Link;
use fewbits_dymbo::{Error, ScalarPlant, filtered_variance, sign_bit};
use fewbits_filters::ScalarSteadyState;
use fewbits_models::Ar1;
use fewbits_numerics::error::{ArgumentError, at_least_one, finite};
use fewbits_numerics::roots::bracketed;
use std::f64::consts::FRAC_2_PI;

/// The noise ratio `gamma` at which [`ScalarPlant::loss`] reaches `level` for the given coefficient; `None` if it never does.
///
/// # Errors
/// If `level` is 1 or less, or `|a| > 1`.
pub fn noise_ratio_at_loss(level: f64, coefficient: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    let at = |log_gamma: f64| ScalarPlant::with_noise_ratio(coefficient, log_gamma.exp())?.loss();
    Ok(crossing(level, LOG_GAMMA, at)?.map(f64::exp))
}

/// The coefficient `|a|` at which [`ScalarPlant::loss`] reaches `level` for the given noise ratio; `None` where it never does in `[0, 1]`.
///
/// # Errors
/// If `level` is 1 or less, or `noise_ratio` is not positive.
pub fn coefficient_at_loss(level: f64, noise_ratio: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    crossing(level, (0.0, 1.0), |a| ScalarPlant::with_noise_ratio(a, noise_ratio)?.loss())
}

/// Range of `ln gamma` that is searched.
const LOG_GAMMA: (f64, f64) = (-30.0, 30.0);

fn check_level(level: f64) -> Result<(), Error> {
    if finite("level", level)? > 1.0 {
        Ok(())
    } else {
        Err(ArgumentError::new("level", level, "a loss above 1").into())
    }
}

/// Where an increasing function crosses `level` within `range`, if it does.
pub(super) fn crossing(
    level: f64,
    (low, high): (f64, f64),
    function: impl Fn(f64) -> Result<f64, Error>,
) -> Result<Option<f64>, Error> {
    if function(low)? > level || function(high)? < level {
        return Ok(None);
    }
    // The solver takes plain numbers: an error is kept aside and ends the search as NaN.
    let mut failure = None;
    let offset = |x: f64| match function(x) {
        Ok(y) => y - level,
        Err(error) => {
            failure = Some(error);
            f64::NAN
        }
    };
    let root = bracketed(offset, low, high, 0.0);
    failure.map_or_else(|| Ok(Some(root?)), Err)
}

/// Upper bound on the mean filtered variance if each bit is lost independently with the link's probability `p`, and both ends know
/// which bits are lost: the steady state with information `(1 - p)(2/pi)(1 - 2 eps)^2`, `eps` the crossover.
///
/// One step of the variance is concave in the variance and linear in the indicator of arrival. By Jensen's inequality, averaging the
/// indicator first gives an upper bound. It is within 0.4 % in the paper's range.
///
/// # Errors
/// If there is no finite bound.
pub fn erasure_bound(plant: &ScalarPlant, link: &Link) -> Result<ScalarSteadyState, Error> {
    plant.steady_state(sign_bit::information(link) * link.arrival())
}

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
    let one_bit = plant.steady_state(sign_bit::information(link))?.predicted_variance;
    let next = |p: f64| plant.dynamics().predict_variance(slot(p));
    // The recursion falls from one bit's fixed point to its own, and never below the process noise.
    let (low, high) = (plant.process_variance(), one_bit * (1.0 + 1e-9));
    let root = crossing(0.0, (low, high), |p| Ok(p - next(p)))?;
    let predicted_variance = root.unwrap_or(one_bit);
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
    use super::{coefficient_at_loss, crossing, erasure_bound, noise_ratio_at_loss, sequential_steady_state};
    use fewbits_core::Link;
    use fewbits_dymbo::{Error, ScalarPlant};

    #[test]
    fn contours_lie_on_the_surface() {
        for a in [0.0, 0.3, 0.9, 1.0] {
            for level in [1.05, 2.0, 3.0] {
                // At a = 1 the loss starts at sqrt(pi/2), so lower levels are never crossed.
                match noise_ratio_at_loss(level, a).unwrap() {
                    Some(gamma) => {
                        let plant = ScalarPlant::with_noise_ratio(a, gamma).unwrap();
                        assert!((plant.loss().unwrap() - level).abs() < 1e-12);
                    }
                    None => assert!(a == 1.0 && level < 1.2533),
                }
            }
        }
        assert_eq!(coefficient_at_loss(2.0, 0.5).unwrap(), None);
        assert!(noise_ratio_at_loss(1.0, 0.5).is_err() && noise_ratio_at_loss(2.0, 1.1).is_err());
        assert!(ScalarPlant::new(0.5, 0.0, 1.0).unwrap().loss().is_err());
    }

    #[test]
    fn crossings_are_within_their_range() {
        let line = |x: f64| Ok(x);
        for (level, found) in [
            (2.0, Some(2.0)),
            (2.4, Some(2.4)),
            (3.0, Some(3.0)),
            (1.9, None),
            (3.1, None),
        ] {
            assert_eq!(crossing(level, (2.0, 3.0), line), Ok(found));
        }
        let ends = |x: f64| if x.abs() == 1.0 { Ok(x) } else { Err(Error::Impossible) };
        assert_eq!(crossing(0.1, (-1.0, 1.0), ends), Err(Error::Impossible));
    }

    #[test]
    fn losing_all_bits_leaves_the_plant_alone() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let at = |link: Link| erasure_bound(&plant, &link).unwrap().filtered_variance;
        let alone = plant.dynamics().stationary_variance().unwrap();
        assert!((at(Link::flipping(0.5).unwrap()) - alone).abs() < 1e-12);
        assert!((at(Link::lossy(1.0 - 1e-12).unwrap()) - alone).abs() < 1e-10);
        let one = sequential_steady_state(&plant, 1).unwrap().filtered_variance;
        assert!((one - at(Link::PERFECT)).abs() < 1e-13);
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
