//! Sums in four lanes: faster than one chain of additions, closer to the true sum, and in a fixed order.

/// `sum_i term(i)` for `i` in `0..count`, accumulated in four interleaved lanes.
///
/// The order depends on `count` alone, so that equal inputs give equal bits.
#[inline]
pub fn lanes(count: usize, term: impl Fn(usize) -> f64) -> f64 {
    let mut lane = [0.0; 4];
    let whole = count - count % 4;
    for i in (0..whole).step_by(4) {
        for (j, sum) in lane.iter_mut().enumerate() {
            *sum += term(i + j);
        }
    }
    for i in whole..count {
        lane[i - whole] += term(i);
    }
    (lane[0] + lane[1]) + (lane[2] + lane[3])
}

/// `sum a_i b_i` over the shorter of the two.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let (a, b) = (&a[..count], &b[..count]);
    lanes(count, |i| a[i] * b[i])
}

/// `sum a_i`.
#[inline]
pub fn sum(a: &[f64]) -> f64 {
    lanes(a.len(), |i| a[i])
}

/// The largest entry; `-inf` of nothing. NaN is passed over.
#[inline]
pub fn largest(a: &[f64]) -> f64 {
    let mut lane = [f64::NEG_INFINITY; 8];
    let chunks = a.chunks_exact(8);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (largest, x) in lane.iter_mut().zip(chunk) {
            *largest = if *x > *largest { *x } else { *largest };
        }
    }
    let whole = lane.iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x));
    rest.iter().fold(whole, |m, x| m.max(*x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remainder_of_four_is_summed_once() {
        for count in 0..13 {
            let values: Vec<f64> = (0..count).map(|i| i as f64 + 1.0).collect();
            assert_eq!(sum(&values), (count * (count + 1) / 2) as f64);
            assert_eq!(dot(&values, &values), values.iter().map(|v| v * v).sum::<f64>());
            assert_eq!(largest(&values), if count == 0 { f64::NEG_INFINITY } else { count as f64 });
        }
    }
}
