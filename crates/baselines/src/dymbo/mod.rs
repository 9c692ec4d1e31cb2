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
//! | the exact error of every scalar filter, without simulation | [`chain`] |
//! | the published centre of identical sensors over bits | [`centre`] |

pub mod centre;
pub mod chain;
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

use fewbits_core::Gaussian;
use fewbits_dymbo::{Error, ScalarPlant};

/// The largest variance of the state within `steps` slots without any message, from `start` on.
fn widest_variance(plant: &ScalarPlant, start: f64, steps: usize) -> Result<f64, Error> {
    let start = Gaussian::scalar(0.0, start)?;
    let beliefs = std::iter::successors(Some(start), |belief| Some(plant.predict(belief)));
    Ok(beliefs
        .take(steps + 1)
        .map(|belief| belief.covariance()[0])
        .fold(0.0, f64::max))
}
