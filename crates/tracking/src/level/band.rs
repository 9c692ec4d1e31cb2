//! The band of an estimate, and what a lone sensor says that is not believed yet.
//!
//! ```text
//! first value that is too unlikely     wild, or the level jumped: nothing tells, and most are wild
//! second and third near it             the band holds them too
//! fourth                               the forecast is wrong: the level is reopened
//! ```

use fewbits_core::Gaussian;

/// Standard deviations in half of a band of 95 %.
const HALF_BAND: f64 = 1.96;
/// Values are near each other within so many deviations of the noise.
const NEAR: f64 = 6.0;

/// Mean and standard deviation of each coordinate. `wider`: factor of the level's; `zero`: deviation of what all of its values may be off.
pub(crate) fn moments<const D: usize>(belief: &Gaussian<D>, wider: f64, zero: f64) -> Vec<(f64, f64)> {
    let deviation = |i: usize| {
        let own = belief.covariance()[(i, i)].sqrt();
        if i == 0 { (wider * own).hypot(zero) } else { own }
    };
    (0..D).map(|i| (belief.mean()[i], deviation(i))).collect()
}

/// The last of the values of a lone sensor that were rejected in a row.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Pending(Option<f64>);

impl Pending {
    /// There is none.
    pub(crate) fn clear(&mut self) {
        self.0 = None;
    }

    /// Adds one: the deviation of a level whose band holds it, if it is near the one before, and 0 otherwise.
    pub(crate) fn add(&mut self, value: f64, noise: f64, level: f64) -> f64 {
        let before = self.0.replace(value);
        if before.is_none_or(|before| (value - before).abs() > NEAR * noise) {
            return 0.0;
        }
        (value - level).abs() / HALF_BAND + noise
    }
}
