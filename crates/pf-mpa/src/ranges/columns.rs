//! The next range by the filters of a bank, column by column, so that a loop over filters runs in vector registers.

use super::gaussian::Predicted;

/// Of each filter that is not left out, in their order.
#[derive(Debug, Default)]
pub(super) struct Columns {
    /// Mean and variance of the noise-free range, and the variance with noise.
    pub(super) mean: Vec<f64>,
    pub(super) variance: Vec<f64>,
    pub(super) total: Vec<f64>,
    /// Its covariances with the state, filter by filter.
    pub(super) cross: Vec<f64>,
    /// What arrived: its density or probability, mean and variance of the noise-free range afterwards, and the innovation in its own deviations.
    pub(super) density: Vec<f64>,
    pub(super) after: Vec<f64>,
    pub(super) left: Vec<f64>,
    pub(super) score: Vec<f64>,
    /// Density or probability of what arrived if it may be an outlier.
    pub(super) evidence: Vec<f64>,
}

impl Columns {
    /// Leaves room for so many covariances with states.
    pub(super) fn clear(&mut self, covariances: usize) {
        self.mean.clear();
        self.variance.clear();
        self.total.clear();
        self.cross.resize(covariances, 0.0);
    }

    /// Adds a filter's expectation.
    pub(super) fn push(&mut self, found: Predicted, total: f64) {
        self.mean.push(found.mean);
        self.variance.push(found.variance);
        self.total.push(total);
    }

    /// What a filter expects, for states of so many coordinates.
    pub(super) fn expected(&self, k: usize, size: usize) -> (Predicted, &[f64]) {
        let found = Predicted {
            mean: self.mean[k],
            variance: self.variance[k],
        };
        (found, &self.cross[k * size..][..size])
    }

    /// Makes room for what arrived.
    pub(super) fn extend(&mut self) {
        let count = self.mean.len();
        for column in [
            &mut self.density,
            &mut self.after,
            &mut self.left,
            &mut self.score,
            &mut self.evidence,
        ] {
            column.resize(count, 0.0);
        }
    }
}
