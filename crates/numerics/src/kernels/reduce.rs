//! Sums and maxima in eight lanes: faster than one chain of additions, closer to the true sum, and in a fixed order.

use super::elementary;
use super::vectorised;

/// Lanes of every reduction on every machine: the order of additions determines the rounding of the result.
pub const LANES: usize = 8;

/// Elements that are processed together; a multiple of [`LANES`].
const BLOCK: usize = 512;

/// Below this distance from zero the exponential of a number is neither subnormal nor infinite.
const ORDINARY: f64 = 700.0;

/// Sum of the lanes, added in a fixed order.
#[inline(always)]
pub fn folded(lane: [f64; LANES]) -> f64 {
    ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]))
}

/// `sum a_i b_i` over the length of the shorter slice.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let count = a.len().min(b.len());
            let (a, b) = (a[..count].chunks_exact(LANES), b[..count].chunks_exact(LANES));
            let mut lane = [0.0; LANES];
            // The rest that fills no group of lanes begins the sums; it has fewer elements than there are lanes.
            for (j, (x, y)) in a.remainder().iter().zip(b.remainder()).enumerate() {
                lane[j] = x * y;
            }
            for (x, y) in a.zip(b) {
                for j in 0..LANES {
                    lane[j] += x[j] * y[j];
                }
            }
            folded(lane)
        },
    )
}

/// `sum w_i (a_i - mean_a) (b_i - mean_b)` over the length of the shortest of the three slices. Not divided by the sum of weights.
pub fn weighted_covariance(weights: &[f64], (a, mean_a): (&[f64], f64), (b, mean_b): (&[f64], f64)) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let count = weights.len().min(a.len()).min(b.len());
            let whole = count - count % LANES;
            let mut lane = [0.0; LANES];
            for i in whole..count {
                lane[i - whole] = weights[i] * (a[i] - mean_a) * (b[i] - mean_b);
            }
            let columns = a[..whole].chunks_exact(LANES).zip(b[..whole].chunks_exact(LANES));
            for (w, (a, b)) in weights[..whole].chunks_exact(LANES).zip(columns) {
                for j in 0..LANES {
                    lane[j] += w[j] * (a[j] - mean_a) * (b[j] - mean_b);
                }
            }
            folded(lane)
        },
    )
}

/// `sum a_i`.
pub fn sum(a: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let chunks = a.chunks_exact(LANES);
            let mut lane = [0.0; LANES];
            lane[..chunks.remainder().len()].copy_from_slice(chunks.remainder());
            for chunk in chunks {
                for j in 0..LANES {
                    lane[j] += chunk[j];
                }
            }
            folded(lane)
        },
    )
}

/// The largest entry, entries of NaN ignored; `-inf` of an empty slice.
pub fn largest(a: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let chunks = a.chunks_exact(LANES);
            let mut lane = [f64::NEG_INFINITY; LANES];
            for (largest, x) in lane.iter_mut().zip(chunks.remainder()) {
                *largest = if *x > *largest { *x } else { *largest };
            }
            for chunk in chunks {
                for j in 0..LANES {
                    lane[j] = if chunk[j] > lane[j] { chunk[j] } else { lane[j] };
                }
            }
            lane.into_iter().fold(f64::NEG_INFINITY, f64::max)
        },
    )
}

/// The largest entry; `-inf` of an empty slice; `None` if an entry is NaN. One pass.
pub fn largest_number(a: &[f64]) -> Option<f64> {
    vectorised(
        #[inline(always)]
        || {
            let chunks = a.chunks_exact(LANES);
            let (mut lane, mut not_numbers) = ([f64::NEG_INFINITY; LANES], [0_u64; LANES]);
            for (j, x) in chunks.remainder().iter().enumerate() {
                lane[j] = *x;
                not_numbers[j] = u64::from(x.is_nan());
            }
            for chunk in chunks {
                for j in 0..LANES {
                    lane[j] = if chunk[j] > lane[j] { chunk[j] } else { lane[j] };
                    not_numbers[j] |= u64::from(chunk[j].is_nan());
                }
            }
            let all = not_numbers == [0; LANES];
            all.then(|| lane.into_iter().fold(f64::NEG_INFINITY, f64::max))
        },
    )
}

/// Sums of the exponentials `e_i` of [`exp_minus`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpSums {
    /// `sum e_i`.
    pub sum: f64,
    /// `sum e_i^2`.
    pub sum_of_squares: f64,
}

/// Writes `e_i = exp(logs[i] - offset)` to `out[i]` over the length of the shorter slice and returns `sum e_i` and `sum e_i^2` (weights,
/// their total, and the sum that the effective sample size needs) in one pass.
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is not ordinary")]
pub fn exp_minus(logs: &[f64], offset: f64, out: &mut [f64]) -> ExpSums {
    vectorised(
        #[inline(always)]
        || {
            let count = logs.len().min(out.len());
            let (mut lane, mut square) = ([0.0; LANES], [0.0; LANES]);
            // Blocks that stay in the first-level cache. Two sums in one loop would not be in vector registers.
            for (out, logs) in out[..count].chunks_mut(BLOCK).zip(logs[..count].chunks(BLOCK)) {
                let beyond = logs
                    .iter()
                    .fold(0, |all, log| all | u64::from(!((log - offset).abs() < ORDINARY)));
                if beyond == 0 {
                    for (out, log) in out.iter_mut().zip(logs) {
                        *out = elementary::exp_normal(log - offset);
                    }
                } else {
                    for (out, log) in out.iter_mut().zip(logs) {
                        *out = elementary::exp(log - offset);
                    }
                }
                let chunks = out.chunks_exact(LANES);
                for (j, e) in chunks.remainder().iter().enumerate() {
                    lane[j] += e;
                    square[j] += e * e;
                }
                for chunk in chunks.clone() {
                    for j in 0..LANES {
                        lane[j] += chunk[j];
                    }
                }
                for chunk in chunks {
                    for j in 0..LANES {
                        square[j] += chunk[j] * chunk[j];
                    }
                }
            }
            ExpSums {
                sum: folded(lane),
                sum_of_squares: folded(square),
            }
        },
    )
}

/// `ln sum exp(logs[i])` without overflow. `-inf` if the slice is empty or all entries are `-inf`; `+inf` if an entry is `+inf`; NaN if
/// an entry is NaN.
pub fn log_sum_exp(logs: &[f64]) -> f64 {
    // The largest entry is subtracted, so that the largest exponential is 1.
    let offset = largest(logs);
    if !offset.is_finite() {
        return if logs.iter().any(|x| x.is_nan()) {
            f64::NAN
        } else {
            offset
        };
    }
    let total = vectorised(
        #[inline(always)]
        || {
            let chunks = logs.chunks_exact(LANES);
            let mut lane = [0.0; LANES];
            for (j, log) in chunks.remainder().iter().enumerate() {
                lane[j] = elementary::exp(log - offset);
            }
            for chunk in chunks {
                for j in 0..LANES {
                    lane[j] += elementary::exp(chunk[j] - offset);
                }
            }
            folded(lane)
        },
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

    /// Whether a block has ordinary numbers only or others too.
    #[test]
    fn weights_have_the_bits_of_the_exponential() {
        let mut logs: Vec<f64> = (0..5 * BLOCK + 3)
            .map(|i| 1398.0 * (i as f64 * 0.618).fract() - 699.0)
            .collect();
        let others = [
            -700.0,
            699.999_999,
            708.5,
            -744.9,
            f64::NEG_INFINITY,
            f64::NAN,
            f64::INFINITY,
        ];
        for (at, other) in others.into_iter().enumerate() {
            logs[2 * BLOCK + 70 * at] = other;
        }
        let mut out = vec![0.0; logs.len()];
        exp_minus(&logs, 0.0, &mut out);
        for (log, e) in logs.iter().zip(&out) {
            let expected = elementary::exp(*log);
            assert!(e.to_bits() == expected.to_bits() || e.is_nan() && expected.is_nan(), "exp({log})");
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
