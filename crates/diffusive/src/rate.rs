//! The release rate: known, or integrated out.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, non_negative, positive, within};
use fewbits_numerics::kernels;
use fewbits_numerics::normal::{LN_SQRT_2PI, log_interval, truncated_moments};
use serde::{Deserialize, Serialize};

/// Largest rate, and largest sample and response in units of the noise: products of their squares are then finite.
const MAX_MAGNITUDE: f64 = 1e60;

/// A uniform prior of the release rate, kg/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "(f64, f64)", into = "(f64, f64)")]
pub struct RateRange {
    low: f64,
    high: f64,
}

impl RateRange {
    /// Rates between `low` and `high`, kg/s.
    ///
    /// # Errors
    /// If `low` is negative, or `high` is not above `low` or exceeds 1e60.
    pub fn new(low: f64, high: f64) -> Result<Self, ArgumentError> {
        non_negative("low", low)?;
        within("high", high, 0.0, MAX_MAGNITUDE)?;
        if high > low {
            Ok(Self { low, high })
        } else {
            Err(ArgumentError::new("high", high, format!("a number above `low` = {low}")))
        }
    }

    /// Lower end, kg/s.
    pub fn low(&self) -> f64 {
        self.low
    }

    /// Upper end, kg/s.
    pub fn high(&self) -> f64 {
        self.high
    }

    pub(crate) fn middle(&self) -> f64 {
        0.5 * (self.low + self.high)
    }
}

impl TryFrom<(f64, f64)> for RateRange {
    type Error = ArgumentError;

    fn try_from((low, high): (f64, f64)) -> Result<Self, ArgumentError> {
        Self::new(low, high)
    }
}

impl From<RateRange> for (f64, f64) {
    fn from(range: RateRange) -> Self {
        (range.low, range.high)
    }
}

/// Model of the release rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum RateModel {
    /// The rate is known, kg/s.
    Known(f64),
    /// One unknown rate for all nodes: the correct model, and the default.
    Joint(RateRange),
    /// A new unknown rate for every node: nodes are independent, and the belief is too wide.
    NodeWise(RateRange),
    /// A new unknown rate for every sample: equations (13) and (18) of the paper, the sign in (13) corrected. Inconsistent: the estimate
    /// moves as far away as the largest rate allows.
    SampleWise(RateRange),
}

impl RateModel {
    /// # Errors
    /// If a known rate is not a positive number up to 1e60.
    pub(crate) fn check(&self) -> Result<(), ArgumentError> {
        match self {
            Self::Known(rate) => within("rate", positive("rate", *rate)?, 0.0, MAX_MAGNITUDE).map(|_| ()),
            _ => Ok(()),
        }
    }

    /// The range of the possible rates. For a known rate both ends are equal.
    fn range(&self) -> RateRange {
        match self {
            Self::Known(rate) => RateRange {
                low: *rate,
                high: *rate,
            },
            Self::Joint(range) | Self::NodeWise(range) | Self::SampleWise(range) => *range,
        }
    }

    /// The largest rate that is possible, kg/s.
    pub(crate) fn largest(&self) -> f64 {
        self.range().high
    }

    /// A rate to start an iteration from.
    pub fn typical(&self) -> f64 {
        self.range().middle()
    }

    /// `ln p(samples | position)` of samples that share one rate, without the term `ln(Phi(b) - Phi(a))` of the truncation to the range.
    /// The second value is `(a, b)`; `None` if the truncation removes nothing.
    #[inline]
    pub(crate) fn log_uncut(&self, sums: &RateSums) -> (f64, Option<(f64, f64)>) {
        match self {
            Self::Known(rate) => (sums.log_given_rate(*rate), None),
            Self::Joint(range) | Self::NodeWise(range) | Self::SampleWise(range) => sums.log_uncut(range),
        }
    }

    /// Mean and variance of the rate that samples share, given the position.
    pub(crate) fn given_position(&self, sums: &RateSums) -> (f64, f64) {
        match self {
            Self::Known(rate) => (*rate, 0.0),
            Self::Joint(range) | Self::NodeWise(range) | Self::SampleWise(range) => sums.rate_given_position(range),
        }
    }
}

/// Sufficient statistics of the samples for the rate, at one position of the source: `sum a^2 / sigma^2`, `sum a y / sigma^2`, `sum y^2 / sigma^2`,
/// and the logarithm of the noise's normalisation. Sums of several nodes add.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RateSums {
    /// `A = sum a_j^2 / sigma^2`, (s/kg)^2.
    pub response: f64,
    /// `B = sum a_j y_j / sigma^2`, s/kg.
    pub correlation: f64,
    /// `C = sum y_j^2 / sigma^2`.
    pub energy: f64,
    /// `sum ln(sigma_j sqrt(2 pi))`.
    pub log_noise: f64,
}

/// A normal truncated at this many standard deviations or more on both sides counts as untruncated.
const UNCUT: f64 = 8.5;
/// If the response times the square of the largest rate is below this, the samples do not depend on the rate.
const SILENT: f64 = 1e-12;

impl RateSums {
    /// The sums of samples `y` (bias subtracted) and responses `a` with noise of standard deviation `noise`.
    ///
    /// # Errors
    /// If the lengths differ or are zero, `noise` is not positive, or a sample or response is not finite or beyond 1e60 `noise`.
    pub fn of(samples: &[f64], responses: &[f64], noise: f64) -> Result<Self, ArgumentError> {
        positive("noise", noise)?;
        all_finite("samples", samples)?;
        all_finite("responses", responses)?;
        if samples.len() != responses.len() || samples.is_empty() {
            let expected = format!("{}, one for each sample (at least one)", samples.len());
            return Err(ArgumentError::new("responses", responses.len(), expected));
        }
        let mut sums = Self {
            log_noise: samples.len() as f64 * (noise.ln() + LN_SQRT_2PI),
            ..Self::default()
        };
        for (y, a) in samples.iter().zip(responses) {
            let (y, a) = (
                within("samples over noise", y / noise, -MAX_MAGNITUDE, MAX_MAGNITUDE)?,
                within("responses over noise", a / noise, -MAX_MAGNITUDE, MAX_MAGNITUDE)?,
            );
            sums.response += a * a;
            sums.correlation += a * y;
            sums.energy += y * y;
        }
        Ok(sums)
    }

    /// The sums of both together.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            response: self.response + other.response,
            correlation: self.correlation + other.correlation,
            energy: self.energy + other.energy,
            log_noise: self.log_noise + other.log_noise,
        }
    }

    /// The sums with only the share `share` of the information; the normalisation of the noise is unchanged.
    #[inline]
    pub(crate) fn discounted(&self, share: f64) -> Self {
        Self {
            response: share * self.response,
            correlation: share * self.correlation,
            energy: share * self.energy,
            log_noise: self.log_noise,
        }
    }

    /// `ln p(samples | position, rate)`.
    #[inline]
    pub fn log_given_rate(&self, rate: f64) -> f64 {
        -0.5 * (self.energy - rate * (2.0 * self.correlation - rate * self.response)) - self.log_noise
    }

    /// `ln p(samples | position)` with one rate, uniform over the range, integrated out:
    /// `-(C - B^2/A)/2 + ln sqrt(2 pi / A) - ln(high - low) + ln[Phi((high - B/A) sqrt A) - Phi((low - B/A) sqrt A)]`. For a single
    /// sample it is equation (13) of the paper with its distribution functions in the correct order.
    #[inline]
    pub fn log_marginal(&self, range: &RateRange) -> f64 {
        let (log, cut) = self.log_uncut(range);
        log + cut.map_or(0.0, |(from, to)| log_interval(from, to))
    }

    /// [`log_marginal`](Self::log_marginal) without the term `ln(Phi(b) - Phi(a))`, and `(a, b)` as in
    /// [`RateModel::log_uncut`].
    #[inline]
    fn log_uncut(&self, range: &RateRange) -> (f64, Option<(f64, f64)>) {
        let (a, b) = (self.response, self.correlation);
        if a * range.high * range.high < SILENT {
            return (self.log_given_rate(range.middle()), None);
        }
        // Completing the square in the rate: a normal of mean B / A and variance 1 / A, cut off at the ends of the range.
        let root = a.sqrt();
        let best = b / a;
        let log =
            -0.5 * (self.energy - b * best) + LN_SQRT_2PI - root.ln() - (range.high - range.low).ln() - self.log_noise;
        (log, ends((range.low - best) * root, (range.high - best) * root))
    }

    /// Expected sum of squared residuals over the noise variance, `C - 2 m B + (m^2 + v) A`, for a rate of mean `m` and variance
    /// `v`.
    pub(crate) fn chi_squared(&self, (mean, variance): (f64, f64)) -> f64 {
        (self.energy - mean * (2.0 * self.correlation - mean * self.response) + variance * self.response).max(0.0)
    }

    /// Mean and variance of the rate given the position: `N(B/A, 1/A)` truncated to the range.
    pub(crate) fn rate_given_position(&self, range: &RateRange) -> (f64, f64) {
        if self.response * range.high * range.high < SILENT {
            return uniform(range);
        }
        cut_normal(self.correlation / self.response, self.response.recip(), range)
    }
}

fn uniform(range: &RateRange) -> (f64, f64) {
    let width = range.high - range.low;
    (range.middle(), width * width / 12.0)
}

/// Mean and variance of `N(mean, variance)` truncated to a range.
#[inline]
pub(crate) fn cut_normal(mean: f64, variance: f64, range: &RateRange) -> (f64, f64) {
    let deviation = variance.sqrt();
    let (from, to) = ((range.low - mean) / deviation, (range.high - mean) / deviation);
    if from < -UNCUT && to > UNCUT {
        return (mean, variance);
    }
    match truncated_moments(from, to) {
        Ok(m) => ((mean + deviation * m.mean).clamp(range.low, range.high), variance * m.variance),
        Err(_) => uniform(range),
    }
}

/// The ends of a range in standard deviations of `N(mean, variance)`; `None` if the truncation removes nothing.
#[inline]
pub(crate) fn ends_about(mean: f64, variance: f64, range: &RateRange) -> Option<(f64, f64)> {
    let deviation = variance.sqrt();
    ends((range.low - mean) / deviation, (range.high - mean) / deviation)
}

#[inline]
fn ends(from: f64, to: f64) -> Option<(f64, f64)> {
    (from >= -UNCUT || to <= UNCUT).then_some((from, to))
}

/// Terms `ln(Phi(b) - Phi(a))` that are to be added to entries of a list. They are collected and evaluated together.
#[derive(Debug, Default)]
pub(crate) struct Intervals {
    place: Vec<usize>,
    from: Vec<f64>,
    to: Vec<f64>,
}

impl Intervals {
    /// Records that `ln(Phi(to) - Phi(from))` belongs to the entry `place`; nothing for `None`.
    #[inline]
    pub(crate) fn push(&mut self, place: usize, cut: Option<(f64, f64)>) {
        if let Some((from, to)) = cut {
            self.place.push(place);
            self.from.push(from);
            self.to.push(to);
        }
    }

    /// Adds the recorded terms to `numbers` and clears the list.
    pub(crate) fn add_to(&mut self, numbers: &mut [f64]) {
        kernels::log_interval(&mut self.from, &self.to);
        for (place, log) in self.place.iter().zip(&self.from) {
            numbers[*place] += log;
        }
        self.place.clear();
        self.from.clear();
        self.to.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::{RateRange, RateSums};
    use fewbits_core::laws::wild;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rates_given_the_position_are_possible(x in prop::array::uniform7(any::<u64>().prop_map(wild::number))) {
            let Ok(range) = RateRange::new(x[0], x[1]) else { return Ok(()) };
            if let Ok(sums) = RateSums::of(&x[2..4], &x[4..6], x[6]) {
                let (mean, variance) = sums.rate_given_position(&range);
                prop_assert!((range.low..=range.high).contains(&mean) && variance >= 0.0, "{:?} {:?}: {} {}", sums, range, mean, variance);
                prop_assert!(!sums.chi_squared((mean, variance)).is_nan());
            }
        }
    }
}
