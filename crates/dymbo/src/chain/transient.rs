//! Mean squared error, slot by slot, from the first message on.

use super::{ErrorChain, MessageLaw};
use crate::{DymboFilter, Error, ScalarPlant};
use fewbits_core::Link;
use fewbits_numerics::error::non_negative;
use std::f64::consts::FRAC_2_PI;

/// One slot: the variances that the filter computes, and the exact mean squared error.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TransientStep {
    /// Predicted variance `P` of the filter. In slot 0 it equals the filtered variance.
    pub predicted_variance: f64,
    /// Filtered variance `M` of the filter.
    pub filtered_variance: f64,
    /// Exact mean squared error after the slot's message.
    pub mse: f64,
}

/// Variances and exact errors of the Dymbo filter for `n = 0..=steps` after a first message of resolution `tau` and no prior. The
/// filter starts from `initial_variance`; `sigma^2 + tau^2/12` is the correct one.
///
/// # Errors
/// If `resolution` is not positive, `initial_variance` is negative, or the process noise is zero or too small for a grid.
pub fn first_message_transient(
    plant: &ScalarPlant,
    resolution: f64,
    initial_variance: f64,
    steps: usize,
) -> Result<Vec<TransientStep>, Error> {
    non_negative("initial_variance", initial_variance)?;
    let mut chain = ErrorChain::from_first_message(plant, resolution)?;
    let filter = DymboFilter::new(*plant);
    let mut filtered_variance = initial_variance;
    let mut transient = vec![TransientStep {
        predicted_variance: initial_variance,
        filtered_variance,
        mse: plant.measurement_variance() + resolution * resolution / 12.0,
    }];
    for _ in 0..steps {
        let predicted_variance = plant.dynamics().predict_variance(filtered_variance);
        filtered_variance = crate::filtered_variance(predicted_variance, plant.measurement_variance(), FRAC_2_PI);
        let law = MessageLaw::bit(&filter, predicted_variance, &Link::PERFECT)?;
        transient.push(TransientStep {
            predicted_variance,
            filtered_variance,
            mse: chain.filtered_mse(&law),
        });
        chain.advance(&law);
    }
    Ok(transient)
}
