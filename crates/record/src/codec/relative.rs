//! The lattice of a bound that is relative to each value: even steps below `floor / share`, above them steps that grow with the value.
//!
//! ```text
//! |k| <= last         k * 2 floor                                          last: floor(1 / (2 share))
//! |k| = last + 1 + n  end (1 + share) ((1 + share) / (1 - share))^n        end = (2 last + 1) floor, the edge of the last even cell
//! ```
//!
//! A cell `[a, a (1 + share) / (1 - share)]` has every value within `share` of its point `a (1 + share)`, relative to the value. Points are
//! computed by additions, multiplications and divisions in a fixed order: the same bits on every machine.

/// Part of the share and the floor that is kept for rounding errors.
const SLACK: f64 = 1.0 / (1 << 16) as f64;
/// Largest exponent: beyond it no double follows.
const FARTHEST: f64 = 1500.0;
/// `ln 2` in two parts, of which the first has few bits: its multiples are exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// The lattice of one bound.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    step: f64,
    last: i64,
    /// The edge of the last even cell.
    end: f64,
    /// The point behind it.
    first: f64,
    /// Logarithm of the quotient of neighbouring points.
    growth: f64,
}

/// `2 atanh x = ln((1 + x) / (1 - x))` for `x` in `[0, 0.5]`, by its series.
fn log_of_quotient(x: f64) -> f64 {
    let square = x * x;
    // The next term is below 1e-17 of the first.
    let sum = (0..28)
        .rev()
        .fold(0.0, |sum, n| sum * square + 1.0 / f64::from(2 * n + 1));
    2.0 * x * sum
}

/// `scale e^x` for `x` in `0..=FARTHEST`, at most the largest double.
fn scaled_exp(scale: f64, x: f64) -> f64 {
    let halvings = (x * std::f64::consts::LOG2_E).round();
    let rest = (x - halvings * LN_2_HIGH) - halvings * LN_2_LOW;
    let series = (1..16).rev().fold(1.0, |sum, n| 1.0 + sum * rest / f64::from(n));
    // Three factors, since the power of two alone may exceed all doubles, and its root too.
    let third = (halvings / 3.0).floor();
    let power = |exponent: f64| f64::from_bits(((exponent as i64 + 1023) as u64) << 52);
    (scale * series * power(third) * power(third) * power(halvings - 2.0 * third)).min(f64::MAX)
}

impl Lattice {
    pub(super) fn new(share: f64, floor: f64) -> Self {
        let (share, floor) = (share * (1.0 - SLACK), floor * (1.0 - SLACK));
        let last = (0.5 / share).floor();
        let end = (2.0 * last + 1.0) * floor;
        Self {
            step: 2.0 * floor,
            last: last as i64,
            end,
            first: end * (1.0 + share),
            growth: log_of_quotient(share),
        }
    }

    /// The point of an index; any index has one.
    pub(super) fn value(&self, index: i64) -> f64 {
        let size = index.unsigned_abs().min(i64::MAX as u64) as i64;
        let value = if size <= self.last {
            size as f64 * self.step
        } else {
            let beyond = (size - self.last - 1) as f64;
            scaled_exp(self.first, (beyond * self.growth).min(FARTHEST))
        };
        if index < 0 { -value } else { value }
    }

    /// The index whose point is nearest to a sample, or next to that one. The caller must check that the point is within the bound.
    pub(super) fn index(&self, sample: f64) -> i64 {
        let size = sample.abs();
        let index = if size < self.end {
            ((size / self.step).round() as i64).min(self.last)
        } else {
            // The difference of logarithms, since a quotient may overflow.
            let beyond = ((size.ln() - self.first.ln()) / self.growth).round();
            let beyond = beyond.clamp(0.0, FARTHEST / self.growth) as i64;
            let near = (beyond - 1).max(0)..=beyond + 1;
            let distance = |n: &i64| (self.value(self.last + 1 + n) / size - 1.0).abs();
            let nearest = near.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            self.last + 1 + nearest.unwrap_or(beyond)
        };
        if sample < 0.0 { -index } else { index }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bound::Bound;

    #[test]
    fn every_value_is_near_its_point() {
        for share in [1e-6, 1e-4, 0.01, 0.07, 1.0 / 3.0, 0.5] {
            for floor in [1e-30, 1e-3, 7.0, 1e12] {
                let (lattice, bound) = (Lattice::new(share, floor), Bound::Relative { share, floor });
                for i in -4000..4000 {
                    let x = floor * 1.003_f64.powi(i.max(-3000)) * if i % 2 == 0 { 1.0 } else { -1.0 };
                    for sample in [x, x * 1e40, x * 1e200, f64::from(i) * floor * 0.37] {
                        let value = lattice.value(lattice.index(sample));
                        assert!(
                            !sample.is_finite() || bound.holds(sample, value, None),
                            "{share} {floor} {sample} {value}"
                        );
                    }
                }
                assert_eq!(lattice.value(lattice.index(-0.0)).to_bits(), 0);
                for index in [i64::MIN, i64::MAX, 1 << 50] {
                    assert!(lattice.value(index).is_finite());
                }
            }
        }
    }

    #[test]
    fn functions_are_those_of_the_standard_library() {
        for i in 0..1000 {
            let x = f64::from(i) * 0.0005;
            let quotient = x.ln_1p() - (-x).ln_1p();
            assert!((log_of_quotient(x) - quotient).abs() <= 4e-16 * quotient.max(1e-3), "{x}");
            let y = f64::from(i) * 0.7;
            assert!((scaled_exp(1.0, y) / y.exp() - 1.0).abs() < 2e-13, "{y}");
        }
    }
}
