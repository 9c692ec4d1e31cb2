//! Values whose noise grows with them: of their roots or logarithms it is the same everywhere.
//!
//! ```text
//! root   2 sqrt(v + 3/8)    counts: of a mean of 4 and more the noise is 1 (Anscombe 1948)
//! log    ln v               a noise in proportion to the value: it is that proportion
//! ```

use crate::rows::instant::{Instant, Reports};
use fewbits_filters::calibration::median;

/// Counts of which the noise of the root is 1, at least.
const FEWEST_COUNTS: f64 = 4.0;
/// Triples of values from which it is told whether the noise grows, at least.
const FEWEST: usize = 40;
/// Different values, at least: the noise of coarsely rounded values depends on where the level is between two steps.
const FEWEST_VALUES: usize = 16;
/// Deviations of the rank correlation of noise and level: by chance of one sensor in 1,500.
const CORRELATED: f64 = 3.2;
/// The same of each half of the values.
const CORRELATED_IN_HALF: f64 = 1.0;
/// Mean size of a standard normal variable.
const SIZE_OF_NORMAL: f64 = 0.797_884_560_802_865_4;
/// Variance of counts in their mean: what the level moves is added.
const COUNTED: std::ops::Range<f64> = 0.75..1.6;
/// The noise grows with this power of the level at least, and with this one as that of counts does at most.
const POWERS: [f64; 2] = [0.3, 0.75];

/// A function of values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Transform {
    /// `2 sqrt(v + 3/8)`, for counts.
    Root,
    /// `ln v`, for a noise in proportion to the value.
    Log,
}

impl Transform {
    /// The transform of a value.
    pub fn of(self, value: f64) -> f64 {
        match self {
            Self::Root => 2.0 * (value + 0.375).sqrt(),
            Self::Log => value.ln(),
        }
    }

    /// A line if the transform of most of these values has no noise of one size. They are transformed.
    pub(crate) fn doubt(self, rows: &[Instant]) -> Option<String> {
        let values = rows.iter().flat_map(Instant::values).map(|(_, value)| value).collect();
        (self == Self::Root && median(values) < self.of(FEWEST_COUNTS)).then(|| {
            format!(
                "most counts are below {FEWEST_COUNTS}: the noise of their roots is not the same everywhere, and bands are too narrow; add up the counts \
                 of several rows"
            )
        })
    }

    /// The value of which this is the transform.
    pub fn inverse(self, number: f64) -> f64 {
        match self {
            Self::Root => (0.25 * number.max(0.0).powi(2) - 0.375).max(0.0),
            Self::Log => number.exp(),
        }
    }

    /// Transforms each report, or says which one cannot be.
    pub(crate) fn apply(self, reports: &mut Reports, names: &[String]) -> Result<(), String> {
        for (sensor, cell) in reports {
            let Some(value) = cell.as_mut().filter(|value| value.is_finite()) else {
                continue;
            };
            let (is_right, expected) = match self {
                Self::Root => (*value >= 0.0, "root: 0 or more"),
                Self::Log => (*value > 0.0, "log: above 0"),
            };
            if !is_right {
                return Err(format!(
                    "{value} of `{}`: --transform {expected} is expected",
                    names.get(*sensor).map_or("", String::as_str)
                ));
            }
            *value = self.of(*value);
        }
        Ok(())
    }

    /// The transform of which the noise of these successive values is the same everywhere, if their own grows with the level: whole numbers whose variance
    /// is their mean, or a noise that grows in all, and in both halves, since a noise that is larger later grows with a level that has risen.
    ///
    /// The second difference of three values is independent of their median where the noise is the same everywhere.
    pub(crate) fn suggested(values: &[f64]) -> Option<Self> {
        let mut triples: Vec<Triple> = values
            .chunks_exact(3)
            .map(|one| Triple {
                level: one[0].max(one[1]).min(one[0].min(one[1]).max(one[2])),
                noise: (one[0] - 2.0 * one[1] + one[2]).abs(),
            })
            .collect();
        let count = triples.len();
        if count < FEWEST || values.iter().any(|value| *value < 0.0) {
            return None;
        }
        let is_grown = |part: &[Triple], deviations: f64| correlation(part) * (part.len() as f64).sqrt() > deviations;
        let (first, second) = triples.split_at(count / 2);
        let is_growing = is_grown(&triples, CORRELATED)
            && is_grown(first, CORRELATED_IN_HALF)
            && is_grown(second, CORRELATED_IN_HALF);
        triples.sort_by(|one, other| one.level.total_cmp(&other.level));
        let (low, high) = (&triples[..count / 3], &triples[count - count / 3..]);
        let mean = |part: &[Triple], of: fn(&Triple) -> f64| part.iter().map(of).sum::<f64>() / part.len() as f64;
        // The mean size of the second difference of counts is that of a normal variable of 6 times their mean as its variance.
        let is_count = |part: &[Triple]| {
            let noise = mean(part, |one| one.noise) / SIZE_OF_NORMAL;
            COUNTED.contains(&(noise * noise / (6.0 * mean(part, |one| one.level))))
        };
        if values.iter().all(|value| value.fract() == 0.0) && is_count(low) && is_count(high) {
            return Some(Self::Root);
        }
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        if !is_growing || sorted.len() < FEWEST_VALUES {
            return None;
        }
        let growth = |of: fn(&Triple) -> f64| (mean(high, of) / mean(low, of)).ln();
        let power = growth(|one| one.noise) / growth(|one| one.level);
        let is_log = power > POWERS[1] && values.iter().all(|value| *value > 0.0);
        (power > POWERS[0]).then_some(if is_log { Self::Log } else { Self::Root })
    }

    /// What it is good for, and the option.
    pub(crate) fn hint(self, name: &str) -> String {
        match self {
            Self::Root => format!(
                "the noise of {name} grows as the root of its values, as that of counts does: `track --transform root` says so; without it bands are too narrow \
                 where values are large"
            ),
            Self::Log => format!(
                "the noise of {name} grows in proportion to its values: `track --transform log` says so; without it bands are too narrow where values are large"
            ),
        }
    }
}

/// The median of three successive values, and the size of their second difference.
struct Triple {
    level: f64,
    noise: f64,
}

/// Rank correlation of level and noise.
fn correlation(triples: &[Triple]) -> f64 {
    let ranks = |of: fn(&Triple) -> f64| {
        let mut order: Vec<usize> = (0..triples.len()).collect();
        let value = |i: usize| of(&triples[i]);
        order.sort_by(|i, j| value(*i).total_cmp(&value(*j)));
        let (mut ranks, mut below) = (vec![0.0; triples.len()], 0.0);
        // Equal numbers share the mean of their ranks, which are counted from the middle one.
        for equal in order.chunk_by(|i, j| value(*i) == value(*j)) {
            let count = equal.len() as f64;
            equal
                .iter()
                .for_each(|i| ranks[*i] = below + 0.5 * (count - triples.len() as f64));
            below += count;
        }
        ranks
    };
    let (levels, noises) = (ranks(|one| one.level), ranks(|one| one.noise));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    product(&levels, &noises) / (product(&levels, &levels) * product(&noises, &noises)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::Transform;

    /// Normal numbers, nearly: sums of twelve.
    fn noise(count: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / 2.0_f64.powi(31)
        };
        (0..count)
            .map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0)
            .collect()
    }

    /// Defect: of a sensor that rounds to steps of five times its noise, the noise was said to grow.
    #[test]
    fn rounding_is_no_growth_of_the_noise() {
        let levels = |k: usize| 19.75 + 0.75 * (k as f64 / 20.0).sin();
        let rounded: Vec<f64> = noise(600)
            .iter()
            .enumerate()
            .map(|(k, e)| (levels(k) + 0.2 * e).round())
            .collect();
        assert_eq!(Transform::suggested(&rounded), None);
        let growing = |k: usize| 20.0 + 15.0 * (k as f64 / 20.0).sin();
        let values: Vec<f64> = noise(600)
            .iter()
            .enumerate()
            .map(|(k, e)| growing(k) * (1.0 + 0.1 * e))
            .collect();
        assert_eq!(Transform::suggested(&values), Some(Transform::Log));
    }
}
