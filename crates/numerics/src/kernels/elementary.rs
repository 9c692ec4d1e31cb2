//! Exponential and logarithm without branches, calls or table look-ups.

use core::f64::consts::LOG2_E;

/// `2^52 + 2^51`: adding it leaves the nearest integer in the low bits of the mantissa.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// The upper half of `ln 2`, with enough trailing zeros that its product with an exponent is exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
/// The rest of `ln 2`.
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// At and below this argument the exponential rounds to zero.
const LOWEST: f64 = -746.0;
/// At and above this argument it overflows.
const HIGHEST: f64 = 710.0;
/// The mantissa of one, as a pattern of bits.
const ONE: u64 = 1.0_f64.to_bits();

/// `(exp(r) - 1 - r) / r^2` on `|r| <= ln(2)/2`, interpolated at Chebyshev nodes with 60 digits; error 2e-17.
const EXP: [f64; 10] = [
    0.500_000_000_000_000_1,
    0.166_666_666_666_666_7,
    0.041_666_666_666_623_99,
    0.008_333_333_333_326_112,
    0.001_388_888_891_728_367,
    0.000_198_412_698_749_029_47,
    2.480_152_118_772_122_8e-5,
    2.755_725_529_609_744e-6,
    2.762_013_975_793_959_3e-7,
    2.510_526_023_051_927_8e-8,
];

/// `yes` or `no`; both were computed. A branch would be duplicated into the code that follows and would double the work of a loop.
#[inline(always)]
pub(crate) fn select(condition: bool, yes: f64, no: f64) -> f64 {
    core::hint::select_unpredictable(condition, yes, no)
}

/// Horner's scheme on four interleaved parts. Four short dependency chains run in parallel, where one long chain would limit the speed.
#[inline(always)]
pub(crate) fn polynomial<const N: usize>(coefficients: &[f64; N], x: f64) -> f64 {
    let square = x * x;
    let fourth = square * square;
    let at = |i: usize| if i < N { coefficients[i] } else { 0.0 };
    let last = 4 * ((N - 1) / 4);
    let mut part = [at(last), at(last + 1), at(last + 2), at(last + 3)];
    for i in (0..last / 4).rev() {
        for k in 0..4 {
            // The last group may be short; the coefficients that it lacks are not multiplied.
            let high = if i == last / 4 - 1 && last + k >= N {
                0.0
            } else {
                part[k] * fourth
            };
            part[k] = high + at(4 * i + k);
        }
    }
    (part[0] + part[1] * x) + square * (part[2] + part[3] * x)
}

/// `2^n` for whole `n` in `-1022..=1023`.
#[inline(always)]
fn power_of_two(n: f64) -> f64 {
    f64::from_bits(((n + ROUNDER).to_bits() << 52).wrapping_add(ONE))
}

/// `exp(high + low)` for `|low|` far below `|high|` or below 1.
#[inline(always)]
pub(crate) fn exp_sum(high: f64, low: f64) -> f64 {
    // In this form each clamp is one instruction and keeps NaN.
    let x = select(high > HIGHEST, HIGHEST, high);
    let x = select(x < LOWEST, LOWEST, x);
    // At the ends `low` may be the difference of two infinities.
    let low = select(low.abs() <= 1.0, low, 0.0);
    let n = (x * LOG2_E + ROUNDER) - ROUNDER;
    let r = (x - n * LN_2_HIGH) - (n * LN_2_LOW - low);
    let fraction = 1.0 + (r + r * r * polynomial(&EXP, r));
    // Two factors: the result may be subnormal, or its power of two beyond the range while it is not.
    let first = select(n > 1023.0, 1023.0, n);
    let first = select(first < -1021.0, -1021.0, first);
    fraction * power_of_two(first) * power_of_two(n - first)
}

/// [`exp`] of `x` with `|x| < 708`, whose result is neither subnormal nor infinite: the same bits in fewer steps.
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn exp_normal(x: f64) -> f64 {
    let n = (x * LOG2_E + ROUNDER) - ROUNDER;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    (1.0 + (r + r * r * polynomial(&EXP, r))) * power_of_two(n)
}

/// `exp(x)`: within one unit in the last place, subnormal results within one and a half; 0 and `+inf` beyond the range.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    exp_sum(x, 0.0)
}

/// `exp(-t^2/2)` with a small relative error for large `t`: the square is split into two parts.
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn exp_minus_half_square(t: f64) -> f64 {
    let (high, low) = half_square(t);
    exp_sum(-high, -low)
}

/// `t^2/2` as the sum of two numbers, the first exact. The second is NaN where the first is infinite.
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn half_square(t: f64) -> (f64, f64) {
    // 26 bits: their square is exact.
    let head = f64::from_bits(t.to_bits() & !0x7ff_ffff);
    (0.5 * head * head, 0.5 * (t - head) * (t + head))
}

/// `sqrt(1/2)`, as a pattern of bits: mantissas are taken from `[sqrt(1/2), sqrt(2))`.
const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
/// `2^52` as a pattern of bits: below it the mantissa is an integer.
const INTEGER: u64 = 0x4330_0000_0000_0000;
const TWO_54: f64 = 18_014_398_509_481_984.0;

/// `(ln((1+s)/(1-s)) - 2s) / s` as a polynomial in `s^2` without constant term (Sun Microsystems, `e_log.c`).
const LN: [f64; 7] = [
    0.666_666_666_666_673_5,
    0.399_999_999_994_094_2,
    0.285_714_287_436_623_9,
    0.222_221_984_321_497_84,
    0.181_835_721_616_180_5,
    0.153_138_376_992_093_73,
    0.147_981_986_051_165_86,
];

/// `ln(x) + correction`, where the correction is below the last place of `x` (relative to it).
#[inline(always)]
pub(crate) fn ln_corrected(x: f64, correction: f64) -> f64 {
    // `x = 2^e m` with `m` in `[sqrt(1/2), sqrt(2))`; `ln x = e ln 2 + ln m`, and `ln m` is a series in `s = (m - 1)/(m + 1)`.
    let small = x < f64::MIN_POSITIVE;
    let scaled = select(small, x * TWO_54, x);
    let shifted = scaled.to_bits().wrapping_add(ONE - SQRT_HALF);
    let bias = select(small, 4_503_599_627_370_496.0 + 1_077.0, 4_503_599_627_370_496.0 + 1_023.0);
    let exponent = f64::from_bits((shifted >> 52) | INTEGER) - bias;
    let f = f64::from_bits((shifted & MANTISSA).wrapping_add(SQRT_HALF)) - 1.0;
    let s = f / (2.0 + f);
    let square = s * s;
    let series = square * polynomial(&LN, square);
    let half = 0.5 * f * f;
    let value = exponent * LN_2_HIGH - ((half - (s * (half + series) + (exponent * LN_2_LOW + correction))) - f);
    let value = select(x < f64::INFINITY, value, x);
    let value = select(x > 0.0, value, f64::NAN);
    select(x == 0.0, f64::NEG_INFINITY, value)
}

/// `ln(x)`: within one unit in the last place; `-inf` at zero, NaN below.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    ln_corrected(x, 0.0)
}

/// `ln(1 - y)` for `y` in `[0, 0.65]`, with a small relative error near zero; the result at `y = 0` is `0.0`, never `-0.0`.
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn ln_one_minus(y: f64) -> f64 {
    let rest = 1.0 - y;
    // Rounding error of `rest`, divided by `rest`. A few per cent accuracy of the reciprocal is enough.
    let lost = (1.0 - rest) - y;
    ln_corrected(rest, lost * (2.0 - rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance in units of the last place of `truth`.
    fn ulps(value: f64, truth: f64) -> f64 {
        if value == truth {
            return 0.0;
        }
        (value - truth).abs() / (truth.abs().next_up() - truth.abs())
    }

    #[test]
    fn the_exponential_is_within_a_unit_of_the_librarys() {
        for i in 0..400_000 {
            let x = -708.0 + 1417.0 * f64::from(i) / 400_000.0;
            assert!(ulps(exp(x), libm::exp(x)) <= 1.0, "exp({x:e})");
        }
        for i in 0..40_000 {
            let x = -745.2 + 37.2 * f64::from(i) / 40_000.0;
            assert!(ulps(exp(x), libm::exp(x)) <= 1.5, "exp({x:e})");
        }
        for exponent in -320..0 {
            for sign in [-1.0, 1.0] {
                let x = sign * 10.0_f64.powi(exponent);
                assert!(ulps(exp(x), libm::exp(x)) <= 1.0, "exp({x:e})");
            }
        }
    }

    #[test]
    fn the_logarithm_is_within_a_unit_of_the_librarys() {
        for i in 0..400_000 {
            for x in [
                (f64::from(i) / 400_000.0 * 1400.0 - 700.0).exp(),
                0.3 + 2.5 * f64::from(i) / 400_000.0,
                1.0 + (f64::from(i) - 200_000.0) * 1e-15,
                f64::from_bits(1 + i as u64 * 11_258_999_068),
            ] {
                assert!(ulps(ln(x), libm::log(x)) <= 1.0, "ln({x:e})");
            }
        }
    }

    #[test]
    fn the_ends_are_exact() {
        assert_eq!([exp(0.0), exp(f64::NEG_INFINITY), exp(-1e300), exp(-745.2)], [1.0, 0.0, 0.0, 0.0]);
        assert_eq!([exp(f64::INFINITY), exp(1e300), exp(709.79)], [f64::INFINITY; 3]);
        assert_eq!(exp(-745.1), f64::from_bits(1));
        assert!(exp(709.78).is_finite() && exp(f64::NAN).is_nan());
        assert_eq!([ln(1.0), ln(0.0), ln(-0.0)], [0.0, f64::NEG_INFINITY, f64::NEG_INFINITY]);
        assert_eq!(ln(f64::INFINITY), f64::INFINITY);
        assert!(ln(-1.0).is_nan() && ln(f64::NEG_INFINITY).is_nan() && ln(f64::NAN).is_nan());
        assert!(ulps(ln(f64::from_bits(1)), -744.440_071_921_381_2) <= 1.0);
    }

    #[test]
    fn one_minus_something_keeps_its_small_logarithms() {
        for i in 0..100_000 {
            for y in [0.65 * f64::from(i) / 100_000.0, (-f64::from(i) * 0.007).exp() * 0.65] {
                assert!(ulps(ln_one_minus(y), libm::log1p(-y)) <= 1.5, "ln(1 - {y:e})");
            }
        }
        assert_eq!(ln_one_minus(0.0), 0.0);
    }

    #[test]
    fn a_square_in_two_parts_is_exact() {
        for t in [0.1_f64, 3.7, 38.1, 1e-9, 2.0_f64.sqrt()] {
            let (high, low) = half_square(t);
            // The product of the rounding error of t^2/2, recovered by a fused multiplication.
            let square = t * t;
            let error = t.mul_add(t, -square);
            assert!(((high - 0.5 * square) + (low - 0.5 * error)).abs() <= 1e-31 * square);
        }
    }
}
