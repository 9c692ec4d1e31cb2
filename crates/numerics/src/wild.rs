//! Extreme numbers for tests: values that a caller may pass by mistake, mixed with ordinary ones.
//!
//! ```
//! use fewbits_numerics::wild;
//! // Random bits choose a number; bits of zero choose zero, so that failing cases shrink to simple ones.
//! assert_eq!(wild::number(0), 0.0);
//! ```

/// NaN, infinities, zeros of both signs, and numbers at the limits of `f64`, of its squares and of exact integers.
const EXTREMES: [f64; 20] = [
    0.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    -0.0,
    1.0,
    -1.0,
    1e300,
    -1e300,
    1e-300,
    -1e-300,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    1e154,
    -1e154,
    1e-154,
    1e16,
    -1e16,
];

/// A number determined by 64 bits: an extreme one with probability 2/9, uniform in `[-3, 3)` with 3/9, positive and below 4 with
/// 3/9, and a power of ten from `1e-300` to `1e299` with 1/9.
pub fn number(bits: u64) -> f64 {
    let (kind, rest) = (bits % 9, bits / 9);
    // 2^64 / 9 is above 2^60: 52 bits of the rest are uniform.
    let unit = (rest % (1 << 52)) as f64 / (1_u64 << 52) as f64;
    match kind {
        0 | 1 => EXTREMES[(rest % EXTREMES.len() as u64) as usize],
        2..5 => 6.0 * unit - 3.0,
        5..8 => 1e-3 + 4.0 * unit,
        _ => 10.0_f64.powi((rest % 600) as i32 - 300),
    }
}
