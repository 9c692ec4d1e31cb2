//! Summary statistics with standard errors.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Count, mean and variance, updated value by value (Welford's recursion; Chan's formula for merging).
///
/// ```
/// use fewbits_monte_carlo::Moments;
/// let m: Moments = [1.0, 2.0, 3.0, 4.0].into_iter().collect();
/// assert_eq!((m.count(), m.mean()), (4, 2.5));
/// assert!((m.variance() - 5.0 / 3.0).abs() < 1e-15);
/// assert!((m.standard_error() - (5.0 / 12.0_f64).sqrt()).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
}

impl Moments {
    /// Adds one value.
    #[inline]
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let deviation = value - self.mean;
        self.mean += deviation / self.count as f64;
        self.squares += deviation * (value - self.mean);
    }

    /// Adds all values that another accumulator saw.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let total = (self.count + other.count) as f64;
        let deviation = other.mean - self.mean;
        let share = other.count as f64 / total;
        self.squares += other.squares + deviation * deviation * self.count as f64 * share;
        self.mean += deviation * share;
        self.count += other.count;
    }

    /// Number of values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean; 0 before the first value.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased sample variance; 0 for fewer than two values.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            0.0
        } else {
            self.squares / (self.count - 1) as f64
        }
    }

    /// Standard error of the mean of independent values. Infinite for fewer than two values.
    pub fn standard_error(&self) -> f64 {
        if self.count < 2 {
            return f64::INFINITY;
        }
        (self.variance() / self.count as f64).sqrt()
    }

    /// Square root of the mean, with its standard error by the delta method. For squared errors it is the RMSE.
    pub fn root_mean(&self) -> Estimate {
        let root = self.mean.max(0.0).sqrt();
        Estimate {
            value: root,
            standard_error: if root > 0.0 || self.count < 2 {
                self.standard_error() / (2.0 * root)
            } else {
                0.0
            },
        }
    }

    /// Mean and standard error together.
    pub fn estimate(&self) -> Estimate {
        Estimate {
            value: self.mean,
            standard_error: self.standard_error(),
        }
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut moments = Self::default();
        for value in values {
            moments.add(value);
        }
        moments
    }
}

/// A Monte-Carlo estimate and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Standard error of the estimate; infinite if it is unknown.
    pub standard_error: f64,
}

impl Estimate {
    /// `(value - truth)` divided by the standard error; 0 if value and truth are equal.
    pub fn z_score(&self, truth: f64) -> f64 {
        let deviation = self.value - truth;
        if deviation == 0.0 {
            0.0
        } else {
            deviation / self.standard_error
        }
    }
}
