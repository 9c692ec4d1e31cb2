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
    /// The last residual, and its deviation.
    last: Option<(f64, f64)>,
    sum: f64,
    count: f64,
    pub(super) recent: Recent,
}

/// Share of a product that stays among the latest ones with each range.
const RECALLED: f64 = 0.97;

/// Sums over the latest products, the older the less.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recent {
    pub(super) sum: f64,
    /// Of the sum, for independent residuals.
    pub(super) variance: f64,
    pub(super) weight: f64,
    /// The same sum in the unit of ranges, squared.
    pub(super) squares: f64,
    /// From range to range.
    pub(super) seconds: f64,
}

impl Residuals {
    /// Takes in a residual in its deviation, so many seconds behind the last one.
    pub(super) fn observe(&mut self, residual: f64, deviation: f64, seconds: f64) {
        let residual = residual.clamp(-LARGEST, LARGEST);
        if let Some((last, its)) = self.last.replace((residual, deviation)) {
            let product = last * residual;
            self.sum += product;
            self.count += 1.0;
            let recent = &mut self.recent;
            *recent = Recent {
                sum: RECALLED * recent.sum + product,
                variance: RECALLED * RECALLED * recent.variance + 1.0,
                weight: RECALLED * recent.weight + 1.0,
                squares: RECALLED * recent.squares + product * its * deviation,
                seconds: RECALLED * recent.seconds + seconds,
            };
        }
    }

    /// Forgets the latest products.
    pub(super) fn forget_recent(&mut self) {
        self.recent = Recent::default();
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
