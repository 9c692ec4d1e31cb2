//! The error of a set of estimates.

use crate::assignment::assign;
use fewbits_core::Error;
use fewbits_numerics::error::{finite, positive, refuse};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// The generalised optimal sub-pattern assignment metric (Rahmathullah, García-Fernández and Svensson 2017) with `alpha = 2`, and its parts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Gospa {
    /// The metric, `(localisation + missed + false)^(1/p)`, in the unit of the states.
    pub value: f64,
    /// Sum over assigned pairs of the distance to the power `p`.
    pub localisation: f64,
    /// `cutoff^p / 2` for each true target without an estimate.
    pub missed: f64,
    /// `cutoff^p / 2` for each estimate without a target.
    pub false_targets: f64,
}

/// The distance of a set of estimates from the true targets.
///
/// Pairs further apart than `cutoff` are not assigned: they count as one missed and one false target. `order` is the power `p`.
///
/// # Errors
/// If `cutoff` is not positive and finite, `order` is below 1, or a coordinate is not finite.
pub fn gospa<const K: usize>(
    estimates: &[SVector<f64, K>],
    truth: &[SVector<f64, K>],
    cutoff: f64,
    order: f64,
) -> Result<Gospa, Error> {
    positive("cutoff", cutoff)?;
    if finite("order", order)? < 1.0 {
        return refuse("order", order, "a number of at least 1");
    }
    for point in estimates.iter().chain(truth) {
        fewbits_numerics::error::all_finite("state", point.as_slice())?;
    }
    // Shares of the cut-off, so that no power overflows.
    let distance = |a: &SVector<f64, K>, b: &SVector<f64, K>| ((a - b).norm() / cutoff).min(1.0).powf(order);
    let (few, many) = if estimates.len() <= truth.len() {
        (estimates, truth)
    } else {
        (truth, estimates)
    };
    // An assigned pair at the cut-off or beyond costs as much as the two apart.
    let costs: Vec<Vec<f64>> = few
        .iter()
        .map(|a| many.iter().map(|b| distance(a, b)).collect())
        .collect();
    let found = assign(&costs)?;
    let near: Vec<f64> = found
        .iter()
        .enumerate()
        .map(|(i, j)| costs[i][*j])
        .filter(|d| *d < 1.0)
        .collect();
    let localisation: f64 = near.iter().sum();
    let [missed, false_targets] = [truth.len(), estimates.len()].map(|all| 0.5 * (all - near.len()) as f64);
    let unit = cutoff.powf(order);
    Ok(Gospa {
        value: cutoff * (localisation + missed + false_targets).powf(1.0 / order),
        localisation: localisation * unit,
        missed: missed * unit,
        false_targets: false_targets * unit,
    })
}
