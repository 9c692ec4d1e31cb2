//! Standard errors at the maximum.

use super::parameters::{Estimate, Quantity, Refusal};
use super::problem::Problem;
use super::search::information;
use nalgebra::{DMatrix, DVector};

/// Standard errors above these say that a parameter is not determined: of logarithms, and in units of the search.
const UNDETERMINED_LOG: f64 = 2.0;
const UNDETERMINED: f64 = 30.0;
/// A step in a delay by which the likelihood falls by more than so many nats is halved.
const FAR: f64 = 8.0;

impl Problem<'_> {
    /// Standard errors. Parameters that the readings do not determine are refused, one after the other: the others' errors are those with it
    /// held where it is.
    pub(super) fn errors(&self, refused: &mut Vec<Refusal>) -> Vec<Estimate> {
        // The likelihood has a kink in a delay wherever two readings change places.
        let origin = DVector::zeros(self.free.len());
        let here = self.log_likelihood(&self.model);
        let step = |(i, quantity): (usize, &Quantity)| {
            if !matches!(quantity, Quantity::Delay(_)) {
                return 1e-2;
            }
            let mut step = 0.25;
            let lost = |by: f64| {
                let mut point = origin.clone();
                point[i] = by;
                here - self.log_likelihood(&self.at(&point))
            };
            // Not so far that the likelihood is no parabola any more.
            while step > 1e-3 && lost(step).min(lost(-step)) > FAR {
                step *= 0.5;
            }
            step
        };
        let steps: Vec<f64> = self.free.iter().enumerate().map(step).collect();
        let found = information(|point| self.log_likelihood(&self.at(point)), &origin, &steps);
        let is_number = |i: &usize| found.row(*i).iter().all(|one| one.is_finite());
        let mut left: Vec<usize> = (0..self.free.len()).filter(is_number).collect();
        let mut deviations = vec![f64::INFINITY; self.free.len()];
        let place = |quantity: Quantity| self.free.iter().position(|one| *one == quantity);
        while !left.is_empty() {
            let part = DMatrix::from_fn(left.len(), left.len(), |i, j| found[(left[i], left[j])]);
            let eigen = part.symmetric_eigen();
            let most = |i: usize| {
                let quantity = self.free[left[i]];
                if quantity.is_positive() {
                    UNDETERMINED_LOG
                } else {
                    UNDETERMINED
                }
            };
            let errors: Vec<f64> = (0..left.len())
                .map(|i| {
                    let one = |k: usize| eigen.eigenvectors[(i, k)].powi(2) / eigen.eigenvalues[k].max(1e-6);
                    (0..left.len()).map(one).sum::<f64>().sqrt()
                })
                .collect();
            // The one that exceeds its limit by most.
            let excess = |i: &usize| errors[*i] / most(*i);
            let worst = (0..left.len()).max_by(|one, other| excess(one).total_cmp(&excess(other)));
            let Some(worst) = worst.filter(|worst| excess(worst) > 1.0) else {
                left.iter().zip(&errors).for_each(|(i, error)| deviations[*i] = *error);
                // The offset itself is what is read at a level of zero.
                for (i, quantity) in left.iter().enumerate() {
                    let Quantity::Bias(sensor) = self.free[*quantity] else {
                        continue;
                    };
                    let gain = place(Quantity::Gain(sensor)).and_then(|gain| left.iter().position(|one| *one == gain));
                    let Some(gain) = gain else { continue };
                    let arm = self.scale.middle * self.unit(Quantity::Gain(sensor)) / self.unit(Quantity::Bias(sensor));
                    let one = |k: usize| {
                        let along = eigen.eigenvectors[(i, k)] - arm * eigen.eigenvectors[(gain, k)];
                        along * along / eigen.eigenvalues[k].max(1e-6)
                    };
                    deviations[*quantity] = (0..left.len()).map(one).sum::<f64>().sqrt();
                }
                break;
            };
            deviations[left[worst]] = f64::INFINITY;
            left.remove(worst);
        }
        let mut estimates = Vec::new();
        for (quantity, deviation) in self.free.iter().zip(deviations) {
            let value = self.value(*quantity);
            let unit = if quantity.is_positive() {
                value
            } else {
                self.unit(*quantity)
            };
            if deviation.is_finite() {
                estimates.push(Estimate {
                    quantity: *quantity,
                    value,
                    standard_error: deviation * unit,
                });
            } else {
                refused.push(Refusal {
                    quantity: *quantity,
                    reason: format!("the readings do not determine it; taken as {value:.4e}"),
                });
            }
        }
        estimates
    }
}
