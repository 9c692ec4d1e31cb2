//! Whether residuals last: those of a right geometry are independent from range to range.

/// Residuals of an anchor say nothing yet below so many products.
const FEWEST: f64 = 40.0;
/// A residual counts with so many of its deviations at most: an outlier decides nothing.
const LARGEST: f64 = 3.0;

/// Residuals last from this mean of their products on, and if it is above zero by so many of its deviations.
const LASTING: f64 = 0.25;
const SURE: f64 = 6.0;

/// Products of successive residuals of one anchor, each in its predicted deviation.
#[derive(Debug, Clone, Default)]
pub(super) struct Residuals {
    last: Option<f64>,
    sum: f64,
    count: f64,
}

impl Residuals {
    pub(super) fn observe(&mut self, residual: f64) {
        let residual = residual.clamp(-LARGEST, LARGEST);
        if let Some(last) = self.last.replace(residual) {
            self.sum += last * residual;
            self.count += 1.0;
        }
    }

    /// Forgets the last residual, since the next one belongs to another place.
    pub(super) fn interrupt(&mut self) {
        self.last = None;
    }

    /// The mean product, if it is far above zero.
    pub(super) fn lasting(&self) -> Option<f64> {
        let mean = self.sum / self.count;
        (self.count >= FEWEST && mean > LASTING.max(SURE / self.count.sqrt())).then_some(mean)
    }
}
