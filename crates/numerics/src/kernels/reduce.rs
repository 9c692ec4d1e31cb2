//! Reductions in eight lanes: faster than one chain of additions, closer to the true sum, and in a fixed order.

use super::elementary;
use super::vectorised;

/// Lanes of every reduction, whatever the machine: the order of additions is part of the result.
pub const LANES: usize = 8;

/// Elements of a block; a multiple of [`LANES`].
const BLOCK: usize = 512;

/// Adds the lanes in a fixed tree.
#[inline(always)]
pub fn folded(lane: [f64; LANES]) -> f64 {
    ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]))
}

/// Takes every row of `columns`, as many as the shortest has, to one of the lanes: first those behind the last eight, then eight at a time.
#[inline(always)]
fn in_lanes<const K: usize, T>(lanes: &mut [T; LANES], columns: [&[f64]; K], step: impl Fn(&mut T, [f64; K])) {
    let count = columns.iter().map(|column| column.len()).min().unwrap_or(0);
    let groups = columns.map(|column| column[..count].as_chunks::<LANES>());
    for (j, lane) in lanes.iter_mut().take(count % LANES).enumerate() {
        step(lane, groups.map(|(_, rest)| rest[j]));
    }
    for i in 0..count / LANES {
        let rows = groups.map(|(whole, _)| whole[i]);
        for (j, lane) in lanes.iter_mut().enumerate() {
            step(lane, rows.map(|row| row[j]));
        }
    }
}

/// The sum of a term of every row.
#[inline(always)]
fn summed<const K: usize>(columns: [&[f64]; K], term: impl Fn([f64; K]) -> f64) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let mut lanes = [0.0; LANES];
            in_lanes(
                &mut lanes,
                columns,
                #[inline(always)]
                |lane, row| *lane += term(row),
            );
            folded(lanes)
        },
    )
}

/// `sum a_i b_i` over the shorter of the two.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    summed(
        [a, b],
        #[inline(always)]
        |[x, y]| x * y,
    )
}

/// `sum w_i (a_i - mean_a) (b_i - mean_b)` over the weights; columns must be at least as long, shorter ones end the sum.
pub fn weighted_covariance(weights: &[f64], (a, mean_a): (&[f64], f64), (b, mean_b): (&[f64], f64)) -> f64 {
    summed(
        [weights, a, b],
        #[inline(always)]
        |[w, x, y]| w * (x - mean_a) * (y - mean_b),
    )
}

/// `sum a_i`.
pub fn sum(a: &[f64]) -> f64 {
    summed(
        [a],
        #[inline(always)]
        |[x]| x,
    )
}

/// The largest entry; `-inf` of nothing. NaN is passed over.
pub fn largest(a: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let mut lanes = [f64::NEG_INFINITY; LANES];
            in_lanes(
                &mut lanes,
                [a],
                #[inline(always)]
                |lane, [x]| *lane = if x > *lane { x } else { *lane },
            );
            lanes.into_iter().fold(f64::NEG_INFINITY, f64::max)
        },
    )
}

/// The largest entry, `-inf` of nothing; `None` if an entry is NaN. One pass.
pub fn largest_number(a: &[f64]) -> Option<f64> {
    vectorised(
        #[inline(always)]
        || {
            let (mut lane, mut numbers) = ([f64::NEG_INFINITY; LANES], [true; LANES]);
            let (whole, rest) = a.as_chunks::<LANES>();
            for (j, x) in rest.iter().enumerate() {
                lane[j] = *x;
                numbers[j] = !x.is_nan();
            }
            for chunk in whole {
                for j in 0..LANES {
                    lane[j] = if chunk[j] > lane[j] { chunk[j] } else { lane[j] };
                    numbers[j] &= !chunk[j].is_nan();
                }
            }
            let all = numbers.into_iter().all(|n| n);
            all.then(|| lane.into_iter().fold(f64::NEG_INFINITY, f64::max))
        },
    )
}

/// Sums of a column of exponentials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpSums {
    /// `sum e_i`.
    pub sum: f64,
    /// `sum e_i^2`.
    pub sum_of_squares: f64,
}

/// Writes `e_i = exp(logs[i] - offset)` to `out[i]` over the shorter of the two and returns their sums: weights, their total
/// and what the effective sample size needs, in one pass.
pub fn exp_minus(logs: &[f64], offset: f64, out: &mut [f64]) -> ExpSums {
    vectorised(
        #[inline(always)]
        || {
            let count = logs.len().min(out.len());
            let mut lanes = [(0.0, 0.0); LANES];
            // In blocks that stay in the nearest cache: a loop that only exponentiates, then one that only adds.
            for (out, logs) in out[..count].chunks_mut(BLOCK).zip(logs[..count].chunks(BLOCK)) {
                for (out, log) in out.iter_mut().zip(logs) {
                    *out = elementary::exp(log - offset);
                }
                in_lanes(
                    &mut lanes,
                    [&*out],
                    #[inline(always)]
                    |(sum, square), [e]| {
                        *sum += e;
                        *square += e * e;
                    },
                );
            }
            ExpSums {
                sum: folded(lanes.map(|lane| lane.0)),
                sum_of_squares: folded(lanes.map(|lane| lane.1)),
            }
        },
    )
}

/// `ln sum exp(logs[i])` without overflow: `-inf` of nothing or of zeros alone, `+inf` if an entry is, NaN if an entry is NaN.
pub fn log_sum_exp(logs: &[f64]) -> f64 {
    let offset = largest(logs);
    if !offset.is_finite() {
        return if logs.iter().any(|x| x.is_nan()) {
            f64::NAN
        } else {
            offset
        };
    }
    let total = summed(
        [logs],
        #[inline(always)]
        |[log]| elementary::exp(log - offset),
    );
    offset + elementary::ln(total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remainder_is_summed_once() {
        for count in 0..26 {
            let values: Vec<f64> = (0..count).map(|i| i as f64 + 1.0).collect();
            assert_eq!(sum(&values), (count * (count + 1) / 2) as f64);
            assert_eq!(dot(&values, &values), values.iter().map(|v| v * v).sum::<f64>());
            let squares = weighted_covariance(&values, (&values, 0.0), (&values, -1.0));
            assert_eq!(squares, values.iter().map(|v| v * v * (v + 1.0)).sum::<f64>());
            assert_eq!(largest(&values), if count == 0 { f64::NEG_INFINITY } else { count as f64 });
            let logs: Vec<f64> = values.iter().map(|v| v.ln()).collect();
            let mut out = vec![0.0; count];
            let sums = exp_minus(&logs, 0.0, &mut out);
            assert!((sums.sum - sum(&values)).abs() <= 1e-12);
            assert!((sums.sum_of_squares - dot(&values, &values)).abs() <= 1e-11);
            assert!((log_sum_exp(&logs) - sum(&values).ln()).abs() < 1e-14 || count == 0);
        }
    }

    #[test]
    fn sums_of_exponentials_do_not_overflow() {
        assert!((log_sum_exp(&[1e4, 1e4]) - (1e4 + 2.0_f64.ln())).abs() < 1e-11);
        assert!((log_sum_exp(&[-1e4, f64::NEG_INFINITY]) + 1e4).abs() < 1e-11);
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
        assert_eq!(log_sum_exp(&[f64::NEG_INFINITY; 3]), f64::NEG_INFINITY);
        assert_eq!(log_sum_exp(&[0.0, f64::INFINITY]), f64::INFINITY);
        assert!(log_sum_exp(&[0.0, f64::NAN]).is_nan() && log_sum_exp(&[f64::INFINITY, f64::NAN]).is_nan());
    }

    #[test]
    fn nan_is_no_largest_entry() {
        assert_eq!(largest(&[f64::NAN, 1.0, f64::NAN]), 1.0);
        assert_eq!(largest(&[f64::NAN; 20]), f64::NEG_INFINITY);
        for at in 0..20 {
            let mut values = [f64::NEG_INFINITY; 20];
            values[at] = 3.0;
            assert_eq!(largest_number(&values), Some(3.0));
            values[at] = f64::NAN;
            assert_eq!(largest_number(&values), None);
        }
        assert_eq!(largest_number(&[]), Some(f64::NEG_INFINITY));
    }
}
