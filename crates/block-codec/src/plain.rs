//! The indices of whole columns that lie on their grid, by vector instructions.

use crate::grid::{Grid, PHASES, WHOLE};
use crate::vectors::{SHIFT, rounded, vectorised};
use fewbits_node::adaptive::TENS;

/// Largest index.
const LARGEST_INDEX: f64 = crate::rows::LARGEST as f64;

/// A whole number of at most `2^51` in size as an integer; any other gives any integer.
#[inline(always)]
fn whole(x: f64) -> i64 {
    ((x + SHIFT).to_bits() as i64).wrapping_sub(SHIFT.to_bits() as i64)
}

impl Grid {
    /// The indices of samples on a line that all have one, of moderate size: with arithmetic that is exact in doubles and can be vectorised.
    /// They are those of [`index`](Self::index). `None` if a sample has none, or for other grids.
    pub(crate) fn plain_indices(&self, samples: &[f64], is_within: impl Fn(f64, f64) -> bool) -> Option<Vec<i64>> {
        let (limit, mut indices) = (WHOLE as f64 / 8.0, vec![0; samples.len()]);
        let (own, found) = (*self, indices.as_mut_slice());
        let all = vectorised(
            #[inline(always)]
            move || match own {
                Self::Decimal { decimals, width, phase } => {
                    let moved = Self::digits_moved(width, phase);
                    let twice_moved = (width - 1).wrapping_add(2 * moved) as f64;
                    let (width, moved, ten) = (width as f64, moved as f64, TENS[usize::from(decimals)]);
                    let mut all = true;
                    for (index, sample) in found.iter_mut().zip(samples) {
                        let digits = rounded(sample * ten) - moved;
                        // Exact: a quotient that is not whole is farther from the next whole number than it is rounded.
                        let cell = (digits / width).floor();
                        let value = 0.5 * (2.0 * width * cell + twice_moved) / ten;
                        // Middles must be exact too.
                        let is_exact = (digits.abs() < limit) & ((cell * width).abs() < limit) & (twice_moved < limit);
                        all &= is_exact & (cell.abs() < LARGEST_INDEX) & is_within(value, *sample);
                        *index = whole(cell);
                    }
                    all
                }
                Self::Line { anchor, step, phase } => {
                    let moved = f64::from(phase) / f64::from(PHASES);
                    let mut all = true;
                    for (index, sample) in found.iter_mut().zip(samples) {
                        let cell = rounded((sample - anchor) / step - moved);
                        let value = (anchor + step * (cell + moved)).clamp(f64::MIN, f64::MAX);
                        all &= (cell.abs() < LARGEST_INDEX) & is_within(value, *sample);
                        *index = whole(cell);
                    }
                    all
                }
                _ => false,
            },
        );
        all.then_some(indices)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_indices_are_those_of_each_sample() {
        for (x, expected) in [
            (0.5, 1.0),
            (-0.5, -1.0),
            (0.499_999_999_999_999_94, 0.0),
            (2.5, 3.0),
            (-7.2, -7.0),
            (1e15, 1e15),
        ] {
            assert_eq!((rounded(x), whole(rounded(x))), (expected, expected as i64));
        }
        let samples: Vec<f64> = (-3000..3000_i64).map(|i| (i * i * i % 7919) as f64 / 100.0).collect();
        let mut compared = 0;
        for delta in [0.004, 0.005, 0.037, 1.0, 900.0] {
            for phase in [0, 1, 7, 15] {
                let width = Grid::width(delta, 100.0).map(|width| Grid::Decimal {
                    decimals: 2,
                    width,
                    phase,
                });
                for grid in [Grid::line(delta, 0.0), Grid::line(delta, samples[0])]
                    .into_iter()
                    .chain(width)
                {
                    let grid = grid.with_phase(phase);
                    let own: Vec<i64> = samples.iter().filter_map(|sample| grid.index(*sample, 0)).collect();
                    let within = |value: f64, sample: f64| (value - sample).abs() <= delta;
                    if let Some(found) = grid.plain_indices(&samples, within) {
                        assert_eq!(found, own);
                        compared += 1;
                    }
                }
            }
        }
        assert!(compared >= 40, "{compared}");
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(Grid::line(0.1, 0.0).plain_indices(&[1.0, bad], |_, _| true).is_none());
        }
    }
}
