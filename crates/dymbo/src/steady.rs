//! Where the filters settle, and what the missing bits cost: closed forms and contours.

use crate::{Error, ScalarPlant};
use fewbits_filters::ScalarSteadyState;
use fewbits_numerics::error::{ArgumentError, finite, within};
use std::f64::consts::FRAC_2_PI;

/// Information coefficient of a sign bit at the prediction through a link of known crossover: `(2/pi)(1 - 2 eps)^2`.
///
/// # Errors
/// `crossover` outside `[0, 1/2]`.
pub fn bit_information(crossover: f64) -> Result<f64, Error> {
    let clean = 1.0 - 2.0 * within("crossover", crossover, 0.0, 0.5)?;
    Ok(FRAC_2_PI * clean * clean)
}

/// Ratio of the steady filtered variances of the sign-bit filter and of the Kalman filter on the same plant: at least 1,
/// increasing in `|a|` and in `gamma`.
///
/// The paper prints the inverse (erratum E3) and calls it below 2 for every `gamma < 1` (E4: it is, for `|a| <= 0.979`).
///
/// # Errors
/// No process noise, for which both variances vanish or neither settles at a rate of its own.
pub fn loss(plant: &ScalarPlant) -> Result<f64, Error> {
    let dymbo = plant.steady_state(FRAC_2_PI)?.filtered_variance;
    let kalman = plant.steady_state(1.0)?.filtered_variance;
    if kalman > 0.0 {
        Ok(dymbo / kalman)
    } else {
        Err(ArgumentError::new("process_variance", plant.process_variance(), "a variance above 0").into())
    }
}

/// The noise ratio `gamma` at which [`loss`] reaches `level` for the given coefficient; `None` where it never does.
///
/// # Errors
/// A level of 1 or below, `|a| > 1`.
pub fn noise_ratio_at_loss(level: f64, coefficient: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    let at = |log_gamma: f64| loss(&ScalarPlant::with_noise_ratio(coefficient, log_gamma.exp())?);
    Ok(crossing(level, LOG_GAMMA, at)?.map(f64::exp))
}

/// The coefficient `|a|` at which [`loss`] reaches `level` for the given noise ratio; `None` where it never does in `[0, 1]`.
///
/// # Errors
/// A level of 1 or below, a noise ratio that is not positive.
pub fn coefficient_at_loss(level: f64, noise_ratio: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    crossing(level, (0.0, 1.0), |a| loss(&ScalarPlant::with_noise_ratio(a, noise_ratio)?))
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

/// Rounds after which halving alone has shrunk any interval to rounding.
const ROUNDS: usize = 200;

/// Where an increasing function crosses `level` within `range`, if it does: the method of Ridders, which halves the bracket
/// at worst and converges quadratically at best.
pub fn crossing(
    level: f64,
    range: (f64, f64),
    function: impl Fn(f64) -> Result<f64, Error>,
) -> Result<Option<f64>, Error> {
    let (mut low, mut high) = range;
    let (mut below, mut above) = (function(low)? - level, function(high)? - level);
    if below > 0.0 || above < 0.0 {
        return Ok(None);
    }
    let mut last = f64::NAN;
    for _ in 0..ROUNDS {
        if below == 0.0 || above == 0.0 {
            return Ok(Some(if below == 0.0 { low } else { high }));
        }
        let middle = 0.5 * (low + high);
        let at_middle = function(middle)? - level;
        let guess = middle - (middle - low) * at_middle / (at_middle * at_middle - below * above).sqrt();
        if (guess - last).abs() <= 2.0 * f64::EPSILON * guess.abs() || high - low <= f64::EPSILON * low.abs() {
            return Ok(Some(guess));
        }
        last = guess;
        for (x, y) in [(middle, at_middle), (guess, function(guess)? - level)] {
            if x > low && x < high {
                if y <= 0.0 {
                    (low, below) = (x, y);
                } else {
                    (high, above) = (x, y);
                }
            }
        }
    }
    Ok(Some(last))
}

/// Upper bound on the mean filtered variance when each bit is lost independently with probability `loss`, known to both
/// ends: the steady state with information `(1 - p) 2/pi`.
///
/// One step of the variance is concave in the variance and linear in whether the bit arrives, so averaging inside can only
/// raise it (Jensen). Tight to 0.4 % in the paper's range.
///
/// # Errors
/// `loss` outside `[0, 1]`; no finite bound.
pub fn erasure_bound(plant: &ScalarPlant, loss: f64) -> Result<ScalarSteadyState, Error> {
    let heard = 1.0 - within("loss", loss, 0.0, 1.0)?;
    plant.steady_state(FRAC_2_PI * heard)
}

/// Steps after which a variance recursion that has not settled is given up.
const MOST_STEPS: usize = 1_000_000;

/// Relative changes below this that no longer shrink are rounding.
const ROUNDING: f64 = 1e-13;

/// The fixed point of a slot's variance recursion: `slot` maps a predicted variance to the filtered one.
///
/// # Errors
/// [`Error::NotConverged`].
pub fn settle(plant: &ScalarPlant, slot: impl Fn(f64) -> f64) -> Result<ScalarSteadyState, Error> {
    let mut filtered = plant.measurement_variance();
    let mut last_change = f64::INFINITY;
    for _ in 0..MOST_STEPS {
        let predicted_variance = plant.dynamics().predict_variance(filtered);
        let next = slot(predicted_variance);
        let change = (next - filtered).abs();
        // Near the fixed point changes shrink until rounding is all that is left of them.
        let settled = change <= 1e-15 * next || change <= ROUNDING * next && change >= last_change;
        last_change = change;
        filtered = next;
        if settled {
            return Ok(ScalarSteadyState {
                predicted_variance,
                filtered_variance: filtered,
            });
        }
    }
    Err(Error::NotConverged {
        what: "the variance recursion",
        iterations: MOST_STEPS,
    })
}

/// Steady state with `sensors` sign bits a slot, the threshold refreshed after each bit.
///
/// # Errors
/// [`Error::NotConverged`].
pub fn sequential_steady_state(plant: &ScalarPlant, sensors: usize) -> Result<ScalarSteadyState, Error> {
    settle(plant, |p| (0..sensors).fold(p, |p, _| plant.filtered_variance(p, FRAC_2_PI)))
}

#[cfg(test)]
mod tests {
    use super::{coefficient_at_loss, crossing, erasure_bound, loss, noise_ratio_at_loss, sequential_steady_state};
    use crate::ScalarPlant;

    #[test]
    fn contours_lie_on_the_surface() {
        for a in [0.0, 0.3, 0.9, 1.0] {
            for level in [1.05, 2.0, 3.0] {
                // At a = 1 the loss starts at sqrt(pi/2), so lower levels are never crossed.
                match noise_ratio_at_loss(level, a).unwrap() {
                    Some(gamma) => {
                        let plant = ScalarPlant::with_noise_ratio(a, gamma).unwrap();
                        assert!((loss(&plant).unwrap() - level).abs() < 1e-12);
                    }
                    None => assert!(a == 1.0 && level < 1.2533),
                }
            }
        }
        assert_eq!(coefficient_at_loss(2.0, 0.5).unwrap(), None);
        assert!(noise_ratio_at_loss(1.0, 0.5).is_err() && noise_ratio_at_loss(2.0, 1.1).is_err());
        assert!(loss(&ScalarPlant::new(0.5, 0.0, 1.0).unwrap()).is_err());
    }

    #[test]
    fn crossing_finds_steep_and_flat_roots() {
        let cube = crossing(0.0, (-3.0, 5.0), |x| Ok((x - 1.0).powi(3))).unwrap().unwrap();
        assert!((cube - 1.0).abs() < 1e-5);
        let steep = crossing(0.5, (-1e3, 1e3), |x| Ok(1.0 / (1.0 + (-100.0 * (x - 7.0)).exp())))
            .unwrap()
            .unwrap();
        assert!((steep - 7.0).abs() < 1e-12);
    }

    #[test]
    fn losing_all_bits_leaves_the_plant_alone() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let alone = erasure_bound(&plant, 1.0).unwrap().filtered_variance;
        assert!((alone - plant.dynamics().stationary_variance().unwrap()).abs() < 1e-12);
        assert!(erasure_bound(&plant, 1.1).is_err());
        let one = sequential_steady_state(&plant, 1).unwrap().filtered_variance;
        assert!((one - erasure_bound(&plant, 0.0).unwrap().filtered_variance).abs() < 1e-13);
    }
}
