//! Contours of the loss against the Kalman filter, as its closed form predicts it and exact; and a bound of the error under losses.

use fewbits_core::Link;
use fewbits_dymbo::chain::true_loss;
use fewbits_dymbo::{Error, ScalarPlant, sign_bit};
use fewbits_filters::ScalarSteadyState;
use fewbits_numerics::error::{ArgumentError, finite};
use fewbits_numerics::roots::bracketed;

/// The noise ratio `gamma` at which [`ScalarPlant::loss`] reaches `level` for the given coefficient; `None` if it never does.
///
/// # Errors
/// If `level` is 1 or less, or `|a| > 1`.
pub fn noise_ratio_at_loss(level: f64, coefficient: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    let at = |log_gamma: f64| ScalarPlant::new(coefficient, log_gamma.exp(), 1.0)?.loss();
    Ok(crossing(level, LOG_GAMMA, at)?.map(f64::exp))
}

/// The coefficient `|a|` at which [`ScalarPlant::loss`] reaches `level` for the given noise ratio; `None` where it never does in `[0, 1]`.
///
/// # Errors
/// If `level` is 1 or less, or `noise_ratio` is not positive.
pub fn coefficient_at_loss(level: f64, noise_ratio: f64) -> Result<Option<f64>, Error> {
    check_level(level)?;
    crossing(level, (0.0, 1.0), |a| ScalarPlant::new(a, noise_ratio, 1.0)?.loss())
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
fn crossing(
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

/// The true loss exceeds the predicted one by at most 1.2 % for `|a| <= 1`. A level is therefore reached slightly below the predicted
/// place, and the search starts at this share of it.
const CLOSE: f64 = 0.9;

/// The noise ratio at which [`true_loss`] reaches `level` for the given coefficient. `None` if that does not happen within 10 %
/// below [`noise_ratio_at_loss`].
///
/// # Errors
/// As [`noise_ratio_at_loss`] and [`chain::stationary`](fewbits_dymbo::chain::stationary).
pub fn noise_ratio_at_true_loss(level: f64, coefficient: f64) -> Result<Option<f64>, Error> {
    let Some(predicted) = noise_ratio_at_loss(level, coefficient)? else {
        return Ok(None);
    };
    let at = |log: f64| true_loss(&ScalarPlant::new(coefficient, log.exp(), 1.0)?);
    let root = crossing(level, ((CLOSE * predicted).ln(), predicted.ln()), at)?;
    Ok(root.map(f64::exp))
}

/// The coefficient at which [`true_loss`] reaches `level` for the given noise ratio. `None` if that does not happen within 10 %
/// below [`coefficient_at_loss`].
///
/// # Errors
/// As [`coefficient_at_loss`] and [`chain::stationary`](fewbits_dymbo::chain::stationary).
pub fn coefficient_at_true_loss(level: f64, noise_ratio: f64) -> Result<Option<f64>, Error> {
    let Some(predicted) = coefficient_at_loss(level, noise_ratio)? else {
        return Ok(None);
    };
    let at = |a: f64| true_loss(&ScalarPlant::new(a, noise_ratio, 1.0)?);
    crossing(level, (CLOSE * predicted, predicted), at)
}

#[cfg(test)]
mod tests {
    use super::{
        coefficient_at_loss, coefficient_at_true_loss, crossing, erasure_bound, noise_ratio_at_loss,
        noise_ratio_at_true_loss,
    };
    use fewbits_core::Link;
    use fewbits_dymbo::chain::true_loss;
    use fewbits_dymbo::{Error, ScalarPlant};

    #[test]
    fn contours_lie_on_the_surface() {
        for a in [0.0, 0.3, 0.9, 1.0] {
            for level in [1.05, 2.0, 3.0] {
                // At a = 1 the loss starts at sqrt(pi/2), so lower levels are never crossed.
                match noise_ratio_at_loss(level, a).unwrap() {
                    Some(gamma) => {
                        let plant = ScalarPlant::new(a, gamma, 1.0).unwrap();
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
    }

    #[test]
    fn true_losses_lie_on_their_contours() {
        let gamma = noise_ratio_at_true_loss(2.0, 0.95).unwrap().unwrap();
        assert!((true_loss(&ScalarPlant::new(0.95, gamma, 1.0).unwrap()).unwrap() - 2.0).abs() < 1e-11);
        assert_eq!(noise_ratio_at_true_loss(1.2, 1.0), Ok(None));
        assert_eq!(coefficient_at_true_loss(2.0, 0.5), Ok(None));
    }
}
