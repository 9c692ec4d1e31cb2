//! Powers of one half, for sums of Gaussian kernels whose far tails do not matter.

/// Larger exponents are replaced by this one: the smallest result is `2^-1020`.
const FARTHEST: f64 = 1020.0;
/// `2^52 + 2^51`: adding it leaves the nearest integer in the low bits of the mantissa.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// `2^f` on `|f| <= 1/2`, interpolated at Chebyshev nodes with 50 digits; relative error 3e-16.
const EXP2: [f64; 11] = [
    1.0,
    std::f64::consts::LN_2,
    0.240_226_506_959_100_98,
    0.055_504_108_664_447_72,
    0.009_618_129_107_606_888,
    0.001_333_355_823_016_497_4,
    0.000_154_035_304_417_360_5,
    1.525_265_726_020_083_7e-5,
    1.321_544_258_792_169e-6,
    1.020_869_029_995_830_6e-7,
    7.072_585_949_269_223e-9,
];

/// `2^-s` for `s >= 0`, within three units in the last place. For `s > 1020` the result is `2^-1020`. Takes a third of the work of
/// an exponential, since results are never subnormal and the argument is not split into two parts.
#[inline(always)]
pub fn power_of_half(s: f64) -> f64 {
    let s = if s < FARTHEST { s } else { FARTHEST };
    let shifted = ROUNDER - s;
    let f = (ROUNDER - shifted) - s;
    let mut p = EXP2[10];
    for c in EXP2[..10].iter().rev() {
        p = p * f + c;
    }
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}
