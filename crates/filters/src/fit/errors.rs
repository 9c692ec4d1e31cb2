//! What the readings leave open: standard errors at the maximum.

use super::parameters::{Estimate, Quantity, Refusal};
use super::problem::Problem;
use super::search::information;
use nalgebra::{DMatrix, DVector};

/// Standard errors above these say that a parameter is not determined: of logarithms, and in units of the search.
const UNDETERMINED_LOG: f64 = 2.0;
const UNDETERMINED: f64 = 30.0;
/// A step in a delay by which the likelihood falls by more than so many nats is halved.
const FAR: f64 = 8.0;

/// The covariance of the parameters that the readings determine, in units of the search.
pub(super) struct Spread {
    /// Which, among those that are free.
    pub(super) determined: Vec<usize>,
    /// A factor: the covariance is this times its transpose.
    pub(super) factor: DMatrix<f64>,
}

impl Problem<'_> {
    /// From the second derivatives of the likelihood. Parameters that the readings do not determine are left out, one after the other: the others'
    /// errors are those with it held where it is.
    pub(super) fn spread(&self) -> Spread {
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
        let mut determined: Vec<usize> = (0..self.free.len()).filter(is_number).collect();
        loop {
            let count = determined.len();
            let part = DMatrix::from_fn(count, count, |i, j| found[(determined[i], determined[j])]);
            let mut factor = DMatrix::zeros(count, count);
            if count > 0 {
                let eigen = part.symmetric_eigen();
                let root = eigen.eigenvalues.map(|value| 1.0 / value.max(1e-6).sqrt());
                factor = eigen.eigenvectors * DMatrix::from_diagonal(&root);
            }
            let excess = |i: &usize| {
                let limit = match self.free[determined[*i]].is_positive() {
                    true => UNDETERMINED_LOG,
                    false => UNDETERMINED,
                };
                factor.row(*i).norm() / limit
            };
            // The one that exceeds its limit by most.
            let worst = (0..count).max_by(|one, other| excess(one).total_cmp(&excess(other)));
            let Some(worst) = worst.filter(|worst| excess(worst) > 1.0) else {
                return Spread { determined, factor };
            };
            determined.remove(worst);
        }
    }

    /// Standard errors. Parameters that the readings do not determine are refused.
    pub(super) fn errors(&self, spread: &Spread, refused: &mut Vec<Refusal>) -> Vec<Estimate> {
        let row = |quantity: Quantity| {
            let place = spread.determined.iter().position(|i| self.free[*i] == quantity)?;
            Some(spread.factor.row(place))
        };
        let mut estimates = Vec::new();
        for quantity in &self.free {
            let value = self.value(*quantity);
            let Some(mut along) = row(*quantity).map(|row| row.into_owned()) else {
                refused.push(Refusal {
                    quantity: *quantity,
                    reason: format!("the readings do not determine it; taken as {value:.4e}"),
                });
                continue;
            };
            // The offset itself is what is read at a level of zero.
            if let Quantity::Bias(sensor) = *quantity
                && let Some(gain) = row(Quantity::Gain(sensor))
            {
                along -= gain * (self.scale.middle * self.unit(Quantity::Gain(sensor)) / self.unit(*quantity));
            }
            let unit = match quantity.is_positive() {
                true => value,
                false => self.unit(*quantity),
            };
            estimates.push(Estimate {
                quantity: *quantity,
                value,
                standard_error: along.norm() * unit,
            });
        }
        estimates
    }
}
