//! Where reconstructions lie: a lattice through the first sample.

use crate::Config;
use serde::{Deserialize, Serialize};

/// Indices beyond this size are no longer exact sums: such samples travel whole.
pub(crate) const LARGEST: i64 = 1 << 40;
/// The step is this much shorter than `2 delta`, so that rounding never takes a reconstruction out of its bound.
const SLACK: f64 = 1.0 / (1_u64 << 30) as f64;

/// Points `anchor + step j` with whole `j`; around the circle there are `cells` of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Lattice {
    anchor: f64,
    step: f64,
    delta: f64,
    /// The period, and its number of points.
    circle: Option<(f64, i64)>,
}

impl Lattice {
    pub(crate) fn new(config: &Config, anchor: f64) -> Self {
        let longest = 2.0 * config.delta() * (1.0 - SLACK);
        let (step, circle) = match config.period() {
            None => (longest, None),
            Some(period) => {
                let cells = (period / longest).ceil().max(1.0);
                (period / cells, Some((period, cells as i64)))
            }
        };
        Self {
            anchor,
            step,
            delta: config.delta(),
            circle,
        }
    }

    /// The sample as the receiver wants it: on the circle, if there is one.
    pub(crate) fn reduce(config: &Config, sample: f64) -> f64 {
        match config.period() {
            None => sample,
            Some(period) => wrap(sample, period),
        }
    }

    /// Points on the circle.
    pub(crate) fn cells(&self) -> Option<i64> {
        self.circle.map(|(_, cells)| cells)
    }

    /// One name for each point: around the circle, `0..cells`.
    pub(crate) fn canonical(&self, j: i64) -> i64 {
        self.cells().map_or(j, |cells| j.rem_euclid(cells))
    }

    /// The reconstruction of an index.
    pub(crate) fn value(&self, j: i64) -> f64 {
        let value = self.anchor + self.step * self.canonical(j) as f64;
        self.circle.map_or(value, |(period, _)| wrap(value, period))
    }

    /// The index nearest to a sample (of its names around the circle, the one nearest to `near`); `None` if no point of the
    /// lattice is within `delta` of it or its index is too large.
    pub(crate) fn index(&self, sample: f64, near: i64) -> Option<i64> {
        let offset = (sample - self.anchor) / self.step;
        if !offset.is_finite() || offset.abs() >= LARGEST as f64 {
            return None;
        }
        let nearest = offset.round() as i64;
        let fits = |j: &i64| self.distance(self.value(*j), sample) <= self.delta;
        let j = [nearest, nearest - 1, nearest + 1].into_iter().find(fits)?;
        Some(match self.cells() {
            None => j,
            Some(cells) => {
                let k = (j - near).rem_euclid(cells);
                near + if 2 * k > cells { k - cells } else { k }
            }
        })
    }

    /// Distance of two values, around the circle if there is one.
    pub(crate) fn distance(&self, a: f64, b: f64) -> f64 {
        let straight = (a - b).abs();
        self.circle
            .map_or(straight, |(period, _)| straight.min((period - straight).abs()))
    }

    pub(crate) fn is_valid(&self) -> bool {
        let numbers = [self.anchor, self.step, self.delta].iter().all(|x| x.is_finite());
        numbers && self.step > 0.0 && self.circle.is_none_or(|(period, cells)| period > 0.0 && cells > 0)
    }
}

fn wrap(value: f64, period: f64) -> f64 {
    let wrapped = value.rem_euclid(period);
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
