//! Comparisons that no filter needs.
//!
//! | comparison | module |
//! |---|---|
//! | the posterior of one bit beside the normal density of its moments (Proposition 1b) | [`skew_normal`] |
//! | successive bits about one sample beside one word | [`iterated`] |
//! | the exact moments after a first message, by enumeration of all reports | [`tree`] |
//! | a filter beside the exact posterior of the same bits | [`gap`] |
//! | where the loss reaches a level; a bound of the error under losses | [`contours`] |
//! | what a first message is worth | [`first_message`] |
//! | a filter of its own for sign bits of vector states, one after the other or at once | [`SignFilter`] |
//! | the steady state of the Kalman filter of a vector | [`steady_state`] |
//! | the steady error of a scalar fixed-lag smoother | [`scalar_fixed_lag_variance`] |
//! | the published centre of identical sensors over bits | [`centre`] |

pub mod centre;
pub mod contours;
pub mod first_message;
pub mod gap;
pub mod iterated;
pub mod skew_normal;
mod steady;
pub mod tree;
mod vector;

pub use steady::{SteadyState, scalar_fixed_lag_variance, steady_state};
pub use vector::{SignFilter, VectorInfo};

use fewbits_core::{Gaussian, Link};
use fewbits_dymbo::{Error, ScalarPlant};
use fewbits_numerics::error::finite;
use fewbits_numerics::normal;

/// The largest variance of the state within `steps` slots without any message, from `start` on.
fn widest_variance(plant: &ScalarPlant, start: f64, steps: usize) -> Result<f64, Error> {
    let start = Gaussian::scalar(0.0, start)?;
    let beliefs = std::iter::successors(Some(start), |belief| Some(plant.predict(belief)));
    Ok(beliefs
        .take(steps + 1)
        .map(|belief| belief.covariance()[0])
        .fold(0.0, f64::max))
}

/// The information averaged over both bits if the threshold is `z = offset` innovation standard deviations from the prediction:
/// `(1 - 2 eps)^2 phi(z)^2/(p_+ p_-)`, `p_+` and `p_-` the probabilities of the bits. It is largest at `offset = 0`.
///
/// # Errors
/// If the offset is not finite.
pub fn expected_information(offset: f64, link: &Link) -> Result<f64, Error> {
    let (z, eps) = (finite("offset", offset)?, link.crossover());
    if eps == 0.0 {
        return Ok(normal::inverse_mills(z) * normal::inverse_mills(-z));
    }
    let clean = 1.0 - 2.0 * eps;
    let received = |z: f64| eps + clean * normal::cdf(z);
    let slope = clean * normal::pdf(z);
    Ok(slope * slope / (received(z) * received(-z)))
}

#[cfg(test)]
mod tests {
    use super::expected_information;
    use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme, Sign};
    use fewbits_dymbo::SignBit;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_two_bits_average_to_the_expected_information(z in -3.0..3.0_f64, eps in 0.0..0.5_f64) {
            let (prior, link) = (Gaussian::scalar(0.0, 3.0).unwrap(), Link::flipping(eps).unwrap());
            let mean: f64 = [Sign::Above, Sign::Below]
                .into_iter()
                .map(|bit| SignBit::new(1.0).unwrap().factor(&(2.0 * z), &Observation::Received(bit), &link).unwrap())
                .map(|factor| factor.tilted(&prior).unwrap())
                // P - c P^2/(P + r) with P = 3, r = 1.
                .map(|after| after.log_evidence.exp() * (3.0 - after.covariance[0]) * 4.0 / 9.0)
                .sum();
            prop_assert!((mean - expected_information(z, &link).unwrap()).abs() < 1e-12);
        }
    }

    #[test]
    fn an_offset_is_a_number() {
        assert!(expected_information(f64::NAN, &Link::PERFECT).is_err());
    }
}
