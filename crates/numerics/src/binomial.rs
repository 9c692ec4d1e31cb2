//! Binomial coefficients, exact and in logarithms.

/// `C(n, k)`, exactly; `None` if it needs more than 128 bits. Zero for `k > n`.
pub fn exact(n: u128, k: u128) -> Option<u128> {
    if k > n {
        return Some(0);
    }
    (0..k.min(n - k)).try_fold(1_u128, |c, i| {
        // c (n - i) / (i + 1) is whole; dividing common factors first keeps the product small.
        let (top, bottom) = (n - i, i + 1);
        let common = gcd(c, bottom);
        (c / common).checked_mul(top / (bottom / common))
    })
}

fn gcd(a: u128, b: u128) -> u128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// `C(n, k)`, exact below `u64::MAX`; larger values are returned as `u64::MAX`. For table sizes and inner loops.
pub fn saturating(n: usize, k: usize) -> u64 {
    if k > n {
        return 0;
    }
    let k = k.min(n - k);
    if n <= 60 {
        return (0..k).fold(1, |value, i| value * (n - i) as u64 / (i + 1) as u64);
    }
    let mut value: u128 = 1;
    for i in 0..k {
        value = value * (n - i) as u128 / (i + 1) as u128;
        if value > u128::from(u64::MAX) {
            return u64::MAX;
        }
    }
    value as u64
}

/// `ln C(n, k)` for all `k` in `0..=n`.
///
/// The coefficients behind the logarithms have a relative error below `(n + 2) 2^-53`.
pub fn log_row(n: usize) -> Vec<f64> {
    let mut logs = vec![0.0; n + 1];
    let (mut mantissa, mut offset) = (1.0_f64, 0.0_f64);
    for k in 1..=n / 2 {
        mantissa *= (n + 1 - k) as f64 / k as f64;
        if mantissa > 1e280 {
            // The factors are multiplied as long as the product fits. A logarithm is taken once in hundreds of orders of magnitude.
            offset += mantissa.ln();
            mantissa = 1.0;
        }
        logs[k] = offset + mantissa.ln();
        logs[n - k] = logs[k];
    }
    logs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_obey_pascals_rule() {
        for n in 1..120_u128 {
            for k in 1..=n {
                let (left, right) = (exact(n - 1, k - 1).unwrap(), exact(n - 1, k).unwrap());
                assert_eq!(exact(n, k), Some(left + right));
            }
        }
        assert_eq!(exact(3, 4), Some(0));
        for n in 0..130_usize {
            for k in 0..=n {
                let truth = exact(n as u128, k as u128).unwrap();
                assert_eq!(saturating(n, k), u64::try_from(truth).unwrap_or(u64::MAX));
            }
        }
        assert_eq!(exact(0, 0), Some(1));
        assert_eq!(exact(1000, 500), None);
        assert_eq!(exact(u128::MAX, 1), Some(u128::MAX));
    }

    #[test]
    fn logarithms_agree_with_exact_coefficients_and_sum_to_a_power_of_two() {
        for n in [0, 1, 7, 60, 124] {
            for (k, log) in log_row(n).into_iter().enumerate() {
                let truth = exact(n as u128, k as u128).unwrap() as f64;
                assert!((log - truth.ln()).abs() < 1e-13 * (1.0 + truth.ln()), "C({n}, {k})");
            }
        }
        let n = 5000;
        let top = n as f64 * std::f64::consts::LN_2;
        let sum: f64 = log_row(n).iter().map(|log| (log - top).exp()).sum();
        assert!((sum - 1.0).abs() < 1e-11);
    }
}
