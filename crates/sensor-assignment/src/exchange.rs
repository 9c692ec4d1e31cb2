//! Local search for an assignment of small exact error.

use super::{CodedSensors, Estimator};
use crate::Error;

/// Smallest relative improvement for which two sensors are exchanged.
const IMPROVEMENT: f64 = 1e-12;

/// The result of [`exchange`].
#[derive(Debug, Clone, PartialEq)]
pub struct Exchanged {
    /// An assignment that no exchange of two sensors improves.
    pub assignment: Vec<usize>,
    /// Exact error of the assignment.
    pub error: f64,
    /// Number of errors evaluated.
    pub evaluations: usize,
}

/// Exchanges pairs of sensors as long as the exact error decreases, the best exchange first.
///
/// # Errors
/// If the start is not a permutation.
pub fn exchange(sensors: &CodedSensors, start: &[usize], estimator: Estimator) -> Result<Exchanged, Error> {
    let mut assignment = start.to_vec();
    let mut error = sensors.mse(&assignment, estimator)?;
    let mut evaluations = 1;
    loop {
        // Steepest descent: the best of all exchanges is made, as long as it improves the error by more than rounding.
        let mut best = (error * (1.0 - IMPROVEMENT), None);
        for i in 0..assignment.len() {
            for j in i + 1..assignment.len() {
                assignment.swap(i, j);
                let trial = sensors.mse(&assignment, estimator)?;
                evaluations += 1;
                assignment.swap(i, j);
                if trial < best.0 {
                    best = (trial, Some((i, j)));
                }
            }
        }
        let Some((i, j)) = best.1 else {
            return Ok(Exchanged {
                assignment,
                error,
                evaluations,
            });
        };
        assignment.swap(i, j);
        error = best.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exchange_ends_where_no_exchange_improves() {
        let sensors = CodedSensors::with_variances(1.0, &[0.004, 0.01, 0.02, 0.03, 0.05]).unwrap();
        let found = exchange(&sensors, &[4, 3, 2, 1, 0], Estimator::PosteriorMean).unwrap();
        for (i, j) in (0..5).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let mut other = found.assignment.clone();
            other.swap(i, j);
            assert!(sensors.mse(&other, Estimator::PosteriorMean).unwrap() >= found.error * (1.0 - 1e-9));
        }
        assert!(exchange(&sensors, &[0, 0, 1, 2, 3], Estimator::CellCentre).is_err());
    }
}
