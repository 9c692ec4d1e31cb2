//! Base-2 logarithm and power in `f32`, by additions, multiplications and divisions in a fixed order: the same bits on every machine.
//!
//! They are used for predicted probabilities only. An absolute error of `1e-5` bits in their logarithms is negligible.

/// `log2(x)` of a positive normal number, within `2e-5`.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    // `x = m 2^e` with `m` in [1 / sqrt 2, sqrt 2), then the series of `atanh` in `t = (m - 1) / (m + 1)`.
    let bits = x.to_bits();
    let exponent = (bits.wrapping_sub(0x3f35_04f3) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32));
    let t = (m - 1.0) / (m + 1.0);
    let square = t * t;
    let low = 2.0 * core::f32::consts::LOG2_E + square * 0.961_796_7;
    exponent as f32 + t * (low + square * square * (0.577_078 + square * 0.412_198_6))
}

/// Adding and subtracting this rounds an `f32` below `2^22` to a whole number.
const ROUNDING: f32 = 12_582_912.0;

/// The nearest integer of a value below `2^22` in size, ties to even.
#[inline(always)]
pub fn round(x: f32) -> f32 {
    (x + ROUNDING) - ROUNDING
}

/// `2^x` for `x` clamped to `-100..=100`, within `3e-7` relative.
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    power(x.clamp(-100.0, 100.0))
}

/// `exp2` without clamping. Precondition: `x` in `-126..=126`.
#[inline(always)]
pub fn power(x: f32) -> f32 {
    // The lowest bits of the sum are the integer part, in two's complement.
    let shifted = x + ROUNDING;
    let f = x - (shifted - ROUNDING);
    // Evaluated in pairs, so that fewer operations depend on each other.
    let square = f * f;
    let high =
        (0.240_226_45 + f * 0.055_503_615) + square * ((0.009_618_791 + f * 0.001_339_05) + square * 0.000_152_510_57);
    let fraction = (1.0 + f * core::f32::consts::LN_2) + square * high;
    f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23)) * fraction
}

/// The smaller number, by a comparison: the library's function is a call on small processors.
#[inline(always)]
pub fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger number.
#[inline(always)]
pub fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The probability with these log odds, in bits.
#[inline(always)]
pub fn squash(log_odds: f32) -> f32 {
    1.0 / (1.0 + exp2(-log_odds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn approximations_are_within_their_stated_errors() {
        for i in -4000..4000 {
            let x = i as f32 * 0.02;
            let exact = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 3e-7, "{x}");
            assert!((f64::from(log2(exact as f32)) - f64::from(exact as f32).log2()).abs() < 2e-5, "{x}");
        }
    }
}
