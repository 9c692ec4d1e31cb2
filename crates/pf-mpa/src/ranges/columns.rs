//! The next range by the filters of a bank, column by column, so that a loop over filters runs in vector registers.

/// Of each filter that is not left out, in their order.
#[derive(Debug, Default)]
pub(super) struct Columns {
    /// Mean and variance of the noise-free range, and the variance with noise.
    pub(super) mean: Vec<f64>,
    pub(super) variance: Vec<f64>,
    pub(super) total: Vec<f64>,
    /// What arrived: its density or probability, mean and variance of the noise-free range afterwards, and the innovation in its own deviations.
    pub(super) density: Vec<f64>,
    pub(super) after: Vec<f64>,
    pub(super) left: Vec<f64>,
    pub(super) score: Vec<f64>,
    /// Density or probability of what arrived if it may be an outlier.
    pub(super) evidence: Vec<f64>,
}

impl Columns {
    pub(super) fn clear(&mut self) {
        self.mean.clear();
        self.variance.clear();
        self.total.clear();
    }

    /// Adds a filter's expectation.
    pub(super) fn push(&mut self, mean: f64, variance: f64, total: f64) {
        self.mean.push(mean);
        self.variance.push(variance);
        self.total.push(total);
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
