//! What the readings leave open: standard errors at the maximum.

use super::parameters::{Estimate, Quantity, Refusal};
use super::problem::Problem;
use super::search::information;
use nalgebra::{DMatrix, DVector};

/// Standard errors above these say that a parameter is not determined: of logarithms, and in units of the search.
const UNDETERMINED_LOG: f64 = 2.0;
const UNDETERMINED: f64 = 30.0;
/// A step in a delay by which the likelihood falls by more nats is halved, by fewer doubled, within limits in intervals between readings.
const FAR: f64 = 8.0;
const NEAR: f64 = 2.0;
const DELAYS: std::ops::Range<f64> = 1e-3..8.0;
/// Deviations at which the fall of the likelihood is compared with that of a parabola, and how many times as large one may be.
const COMPARED: [f64; 3] = [1.0, 2.0, 3.0];
const WIDEST: f64 = 30.0;

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
        let origin = DVector::zeros(self.free.len());
        let here = self.log_likelihood(&self.model);
        // The likelihood has a kink in a delay wherever two readings change places.
        let lost = |point: &DVector<f64>| here - self.log_likelihood(&self.at(point));
        let step = |along: &dyn Fn(f64) -> DVector<f64>| {
            let fall = |step: f64| lost(&along(step)).min(lost(&along(-step)));
            let mut step = 0.25;
            let mut found = fall(step);
            // Farther than from one kink to the next, and not so far that the likelihood is no parabola any more.
            while step < DELAYS.end && found < NEAR {
                step *= 2.0;
                found = fall(step);
            }
            while step > DELAYS.start && found > FAR {
                step *= 0.5;
                found = fall(step);
            }
            step
        };
        let delays: Vec<usize> = (0..self.free.len())
            .filter(|i| matches!(self.free[*i], Quantity::Delay(_)))
            .collect();
        let mut steps = vec![1e-2; self.free.len()];
        for i in &delays {
            steps[*i] = step(&|by| {
                let mut point = origin.clone();
                point[*i] = by;
                point
            });
        }
        let mut found = information(|point| self.log_likelihood(&self.at(point)), &origin, &steps);
        if delays.len() > 1 {
            // Kinks of two delays hide how little the readings may tell of what all have in common.
            let mut common = origin.clone();
            delays.iter().for_each(|i| common[*i] = 1.0);
            let by = step(&|by| &common * by);
            let bent = (lost(&(&common * by)) + lost(&(&common * -by))) / (by * by);
            let image = &found * &common;
            let is_bent = common.dot(&image);
            if bent < is_bent {
                found -= &image * image.transpose() * ((1.0 - bent.max(0.0) / is_bent) / is_bent);
            }
        }
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
                return self.with_kinks(Spread { determined, factor });
            };
            determined.remove(worst);
        }
    }

    /// Between kinks the likelihood is more bent than over several of them: each principal deviation is so large that the likelihood falls at least as
    /// far as that of a normal distribution.
    fn with_kinks(&self, mut spread: Spread) -> Spread {
        if !self.free.iter().any(|one| matches!(one, Quantity::Delay(_))) {
            return spread;
        }
        let here = self.log_likelihood(&self.model);
        for mut axis in spread.factor.column_iter_mut() {
            let lost = |by: f64| {
                let mut point = DVector::zeros(self.free.len());
                spread
                    .determined
                    .iter()
                    .zip(axis.iter())
                    .for_each(|(i, along)| point[*i] = by * along);
                here - self.log_likelihood(&self.at(&point))
            };
            let wider = COMPARED.map(|by| by / (2.0 * lost(by).min(lost(-by)).max(0.0)).sqrt());
            let wider = wider.into_iter().fold(1.0, f64::max).min(WIDEST);
            axis *= wider;
        }
        spread
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
                limits: None,
            });
        }
        estimates
    }
}
