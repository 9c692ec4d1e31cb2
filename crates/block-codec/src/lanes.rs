//! Four numbers of single precision at a time, with the same bits as the functions of `fewbits_node::elementary` on each.

use std::ops::{Add, Shl, Sub};
use wide::bytemuck::cast;
use wide::{f32x4, i32x4, u32x4};

/// Four numbers.
pub(crate) type Lanes = f32x4;

/// The bits of the numbers.
#[inline(always)]
pub(crate) fn bits(x: Lanes) -> u32x4 {
    cast(x)
}

/// The larger of two numbers, of each pair; no NaN.
#[inline(always)]
pub(crate) fn greater(a: Lanes, b: f32) -> Lanes {
    a.fast_max(Lanes::splat(b))
}

/// The smaller of two numbers, of each pair; no NaN.
#[inline(always)]
pub(crate) fn lesser(a: Lanes, b: f32) -> Lanes {
    a.fast_min(Lanes::splat(b))
}

/// `log2(x)` of positive normal numbers.
#[inline(always)]
pub(crate) fn log2(x: Lanes) -> Lanes {
    let bits: i32x4 = cast(x);
    let exponent = bits.sub(i32x4::splat(0x3f35_04f3)) >> 23_u32;
    let m: Lanes = cast(bits.sub(exponent.shl(23_u32)));
    let t = (m - 1.0) / (m + 1.0);
    let square = t * t;
    let low = square * 0.961_796_7 + 2.0 * std::f32::consts::LOG2_E;
    Lanes::from_i32x4(exponent) + t * (low + square * square * (square * 0.412_198_6 + 0.577_078))
}

/// Adding and subtracting this rounds a number below `2^22` to a whole number.
const ROUNDING: f32 = 12_582_912.0;

/// `2^x` for `x` in `-126..=126`.
#[inline(always)]
pub(crate) fn power(x: Lanes) -> Lanes {
    let shifted = x + ROUNDING;
    let f = x - (shifted - ROUNDING);
    let square = f * f;
    let high =
        (f * 0.055_503_615 + 0.240_226_45) + square * ((f * 0.001_339_05 + 0.009_618_791) + square * 0.000_152_510_57);
    let fraction = (f * std::f32::consts::LN_2 + 1.0) + square * high;
    let exponent = bits(shifted).shl(23_u32).add(u32x4::splat(127 << 23));
    cast::<u32x4, Lanes>(exponent) * fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_node::elementary;

    #[test]
    fn lanes_have_the_bits_of_single_numbers() {
        for i in -6000..6000 {
            let x = i as f32 * 0.02 + 0.003;
            let numbers = [x, 0.5 * x, x / 3.0, -x];
            let powers = power(Lanes::new(numbers)).to_array();
            let logarithms = log2(Lanes::new(powers)).to_array();
            for ((number, power), logarithm) in numbers.into_iter().zip(powers).zip(logarithms) {
                assert_eq!(power.to_bits(), elementary::power(number).to_bits(), "{number}");
                assert_eq!(logarithm.to_bits(), elementary::log2(power).to_bits(), "{power}");
            }
        }
    }
}
