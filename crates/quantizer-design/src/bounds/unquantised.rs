//! The value of a criterion if the fusion centre had the samples themselves.

use crate::criterion::Criterion;
use crate::error::Error;
use crate::observation_model::ObservationModel;

/// Step of the sum over the sufficient statistic, in standard deviations of its noise.
const STEP: f64 = 0.25;
/// Standard deviations beyond the values of the unknown at which the sum ends.
const REACH: f64 = 8.0;
/// Largest number of terms of the double sum.
const MAX_TERMS: f64 = 2e7;

/// The value of a criterion if all samples arrived unquantised. No design with any number of bits is better.
///
/// All samples together have the same information about the unknown as one sample with noise variance `1 / 1' Sigma^-1 1`. `None` if
/// this noise is so small compared with the prior that the sum would be too long.
///
/// # Errors
/// As [`ObservationModel::new`].
pub fn unquantised(model: &ObservationModel, criterion: Criterion) -> Result<Option<f64>, Error> {
    let deviation = 1.0 / model.noise().precision_of_mean().sqrt();
    let values = model.values();
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let count = ((high - low) / deviation + 2.0 * REACH) / STEP;
    if !(deviation > 0.0 && count * values.len() as f64 <= MAX_TERMS) {
        return Ok(None);
    }
    // The weighted mean of all samples is a sufficient statistic, so one integral over it is enough.
    let (step, mean) = (STEP * deviation, model.prior().mean());
    let (mut explained, mut information, mut correct) = (0.0, 0.0, 0.0);
    for i in 0..=count as usize {
        let s = low - REACH * deviation + i as f64 * step;
        let (mut mass, mut moment, mut largest, mut logs) = (0.0, 0.0, 0.0_f64, 0.0);
        for (x, w) in values.iter().zip(model.weights()) {
            let u = (s - x) / deviation;
            let density = (-0.5 * u * u).exp() * STEP / std::f64::consts::TAU.sqrt();
            let joint = w * density;
            mass += joint;
            moment += joint * (x - mean);
            largest = largest.max(joint);
            if joint > 0.0 {
                logs += joint * density.ln();
            }
        }
        if mass > 0.0 {
            explained += moment * (moment / mass);
            information += logs - mass * mass.ln();
            correct += largest;
        }
    }
    Ok(Some(match criterion {
        Criterion::MeanSquaredError => (model.variance - explained).max(0.0),
        Criterion::MutualInformation => information,
        Criterion::BayesError => 1.0 - correct,
    }))
}
