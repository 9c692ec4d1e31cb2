//! The lattice of reconstructions through the first sample.

use super::Config;
use crate::math::{ceil, rem_euclid, round};
use crate::packet::TENS;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Largest size of an index. Beyond it sums are no longer exact, and samples are sent as whole numbers.
pub(super) const LARGEST: i64 = 1 << 40;
/// Share by which the step is shorter than `2 delta`, so that rounding cannot move a reconstruction out of its bound.
const SLACK: f64 = 1.0 / (1_u64 << 30) as f64;

/// Points `anchor + step j` with integer `j`; on a circle there are `cells` of them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Lattice {
    anchor: f64,
    step: f64,
    delta: f64,
    /// The period, and its number of points.
    circle: Option<(f64, i64)>,
    decimal: Option<Decimal>,
}

/// A lattice whose points are decimal numbers to the last bit: `(anchor + step j) / ten`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
struct Decimal {
    anchor: i64,
    step: i64,
    ten: f64,
}

impl Decimal {
    /// The smallest number of decimals with which both numbers can be written in at most fifteen digits.
    fn find(step: f64, anchor: f64) -> Option<Self> {
        let whole = |x: f64, ten: f64| {
            let digits = round(x * ten);
            (digits.abs() < 1e15 && digits / ten == x).then_some(digits as i64)
        };
        TENS.iter().copied().find_map(|ten| {
            Some(Self {
                anchor: whole(anchor, ten)?,
                step: whole(step, ten)?,
                ten,
            })
        })
    }

    fn value(&self, j: i64) -> f64 {
        (i128::from(self.anchor) + i128::from(self.step) * i128::from(j)) as f64 / self.ten
    }
}

impl Lattice {
    /// Before the first sample.
    pub(super) const UNSET: Self = Self {
        anchor: 0.0,
        step: 0.0,
        delta: 0.0,
        circle: None,
        decimal: None,
    };

    /// The lattice of a configuration through `anchor`.
    pub fn new(config: &Config, anchor: f64) -> Self {
        let longest = 2.0 * config.delta() * (1.0 - SLACK);
        let decimal = config
            .resolution()
            .filter(|_| config.period().is_none())
            .and_then(|step| Decimal::find(step, anchor));
        let (step, circle) = match config.period() {
            None => (decimal.map_or(longest, |_| 2.0 * config.delta()), None),
            Some(period) => {
                let cells = ceil(period / longest).max(1.0);
                (period / cells, Some((period, cells as i64)))
            }
        };
        Self {
            anchor,
            step,
            delta: config.delta(),
            circle,
            decimal,
        }
    }

    /// The sample, reduced to `[0, period)` if there is a circle.
    pub fn reduce(config: &Config, sample: f64) -> f64 {
        match config.period() {
            None => sample,
            Some(period) => wrap(sample, period),
        }
    }

    /// Number of points on the circle, if there is one.
    pub(crate) fn cells(&self) -> Option<i64> {
        self.circle.map(|(_, cells)| cells)
    }

    /// The unique index of a point: `0..cells` on a circle.
    pub(crate) fn canonical(&self, j: i64) -> i64 {
        self.cells().map_or(j, |cells| j.checked_rem_euclid(cells).unwrap_or(0))
    }

    /// The reconstruction of an index.
    pub(crate) fn value(&self, j: i64) -> f64 {
        let value = match &self.decimal {
            Some(decimal) => decimal.value(j),
            None => self.anchor + self.step * self.canonical(j) as f64,
        };
        // After damage an index may exceed those of samples.
        let value = value.clamp(f64::MIN, f64::MAX);
        self.circle.map_or(value, |(period, _)| wrap(value, period))
    }

    /// A difference of indices; on a circle the shorter way.
    pub(crate) fn shortest(&self, difference: i64) -> i64 {
        self.cells().map_or(difference, |cells| {
            let k = difference.checked_rem_euclid(cells).unwrap_or(0);
            if 2 * k > cells { k - cells } else { k }
        })
    }

    /// The index nearest to a sample; on a circle, of its equivalent indices the one nearest to `near`. `None` if no point of the
    /// lattice is within `delta` of it or its index is too large.
    pub(crate) fn index(&self, sample: f64, near: i64) -> Option<i64> {
        let offset = (sample - self.anchor) / self.step;
        if !offset.is_finite() || offset.abs() >= LARGEST as f64 {
            return None;
        }
        let nearest = round(offset) as i64;
        let fits = |j: &i64| self.distance(self.value(*j), sample) <= self.delta;
        let j = [nearest, nearest - 1, nearest + 1].into_iter().find(fits)?;
        Some(near + self.shortest(j - near))
    }

    /// Distance of two values, around the circle if there is one.
    fn distance(&self, a: f64, b: f64) -> f64 {
        let straight = (a - b).abs();
        self.circle
            .map_or(straight, |(period, _)| straight.min((period - straight).abs()))
    }

    /// Whether stored numbers can be those of a lattice of this configuration.
    pub(crate) fn is_valid(&self, config: &Config) -> bool {
        let agreed = self.delta == config.delta() && self.circle.map(|circle| circle.0) == config.period();
        let numbers = [self.anchor, self.step].iter().all(|x| x.is_finite());
        let decimal = self.decimal.is_none_or(|d| d.step > 0 && TENS.contains(&d.ten));
        agreed
            && numbers
            && decimal
            && self.step > 0.0
            && self.circle.is_none_or(|(period, cells)| period > 0.0 && cells > 0)
    }
}

fn wrap(value: f64, period: f64) -> f64 {
    let wrapped = rem_euclid(value, period);
    // A tiny negative value rounds up to the period itself.
    if wrapped < period { wrapped } else { 0.0 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn reconstructions_are_within_delta_or_there_is_none() {
        for delta in [1e-300, 1e-4, 0.5, 1e4, 1e300] {
            for anchor in [0.0, 1e-300, 0.1, -22.7, 1e300] {
                let lattice = Lattice::new(&Config::new(delta).unwrap(), anchor);
                for i in -300..300 {
                    let sample = anchor + 0.37 * delta * f64::from(i);
                    match lattice.index(sample, 0) {
                        Some(j) => assert!((lattice.value(j) - sample).abs() <= delta, "{delta} {anchor} {i}"),
                        None => assert!(anchor.abs() > 1e6 * delta || !sample.is_finite(), "{delta} {anchor} {i}"),
                    }
                }
            }
        }
        assert_eq!(Lattice::new(&Config::new(1e-300).unwrap(), 0.0).index(1e300, 0), None);
    }

    #[test]
    fn ties_of_a_quantised_signal_stay_on_the_lattice() {
        let lattice = Lattice::new(&Config::new(0.001).unwrap(), 22.0);
        for i in -5000..5000 {
            assert!(lattice.index(22.0 + f64::from(i) / 1000.0, 0).is_some(), "{i}");
        }
    }

    #[test]
    fn an_instruments_own_numbers_return_exactly() {
        for (resolution, anchor) in [(0.001, 22.0), (0.0625, -3.25), (1.0, 279.0), (0.1, 1e6)] {
            let lattice = Lattice::new(&Config::exact(resolution).unwrap(), anchor);
            let per_unit = (1.0 / resolution).round();
            for i in -20_000..20_000 {
                let sample = ((anchor * per_unit).round() + f64::from(i)) / per_unit;
                let j = lattice.index(sample, 0).unwrap();
                assert_eq!((j, lattice.value(j)), (i64::from(i), sample));
            }
        }
        // Numbers that no decimals write: the bound alone.
        let lattice = Lattice::new(&Config::exact(1.0 / 3.0).unwrap(), 0.1);
        assert!(lattice.decimal.is_none() && lattice.index(7.0, 0).is_some());
    }

    #[test]
    fn circles_close() {
        let lattice = Lattice::new(&Config::new(5.0).unwrap().circular(360.0).unwrap(), 350.0);
        assert!(lattice.cells().unwrap() >= 36);
        for i in 0..720 {
            let sample = f64::from(i) * 0.5;
            for near in [-1000, 0, 17] {
                let j = lattice.index(sample, near).unwrap();
                assert!((j - near).abs() <= lattice.cells().unwrap() / 2 + 1);
                assert!(lattice.distance(lattice.value(j), sample) <= 5.0);
            }
        }
        assert_eq!(lattice.index(1.0, 0).unwrap(), 1);
    }
}
