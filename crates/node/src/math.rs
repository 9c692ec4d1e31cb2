//! Functions that `core` lacks: those of the standard library with the feature `std`, those of `libm` without. All are exact or
//! correctly rounded, so both give the same bits.

#[cfg(feature = "std")]
mod chosen {
    pub(crate) fn ceil(x: f64) -> f64 {
        x.ceil()
    }

    /// The nearest integer, ties away from zero.
    pub(crate) fn round(x: f64) -> f64 {
        x.round()
    }

    pub(crate) fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }

    pub(crate) fn sqrt_f32(x: f32) -> f32 {
        x.sqrt()
    }

    pub(crate) fn remainder(x: f64, y: f64) -> f64 {
        x % y
    }

    pub(crate) fn twice_ratio(n: u32, d: u32) -> f64 {
        2.0 * (f64::from(n) / f64::from(d))
    }
}

#[cfg(not(feature = "std"))]
mod chosen {
    pub(crate) use super::long_division as remainder;
    pub(crate) use super::twice_ratio_bit_by_bit as twice_ratio;
    pub(crate) use libm::{ceil, round, sqrt, sqrtf as sqrt_f32};
}

pub(crate) use chosen::{ceil, remainder, round, sqrt, sqrt_f32, twice_ratio};

/// The remainder in `[0, period)`. Exception: for a tiny negative value it rounds to `period`.
pub(crate) fn rem_euclid(value: f64, period: f64) -> f64 {
    let rest = remainder(value, period);
    if rest < 0.0 { rest + period } else { rest }
}

/// The exact remainder of `x / y` with the sign of `x`, for finite `x` and `y > 0`, by one subtraction per bit of the quotient. It is
/// slower than the library's function and has a tenth of its code size.
#[cfg(any(not(feature = "std"), test))]
pub(crate) fn long_division(x: f64, y: f64) -> f64 {
    const IMPLICIT: u64 = 1 << 52;
    // Mantissa of 53 bits and exponent: the number is `mantissa 2^exponent` times the smallest positive number.
    let parts = |bits: u64| {
        let exponent = (bits >> 52) as i32;
        let shift = (bits.leading_zeros() as i32 - 11).max(0);
        match exponent {
            0 => (bits << shift, -shift),
            _ => (bits & (IMPLICIT - 1) | IMPLICIT, exponent - 1),
        }
    };
    let ((mut rest, mut exponent), (divisor, last)) = (parts(x.abs().to_bits()), parts(y.to_bits()));
    if x == 0.0 || exponent < last {
        return x;
    }
    while exponent > last {
        if rest >= divisor {
            rest -= divisor;
        }
        // The remainder is below twice the divisor, which is below 2^53.
        rest <<= 1;
        exponent -= 1;
    }
    if rest >= divisor {
        rest -= divisor;
    }
    if rest == 0 {
        return 0.0_f64.copysign(x);
    }
    while rest < IMPLICIT && exponent > 0 {
        rest <<= 1;
        exponent -= 1;
    }
    // Exact: the remainder is a multiple of the smallest positive number.
    rest >>= (-exponent).max(0);
    // A mantissa without its highest bit is that of a subnormal number: its bits need no change.
    f64::from_bits(((exponent.max(0) as u64) << 52) + rest).copysign(x)
}

/// `2 n / d` correctly rounded, for `0 < n < d`, by one subtraction per bit: a tenth of the code size of a division of doubles.
#[cfg(any(not(feature = "std"), test))]
pub(crate) fn twice_ratio_bit_by_bit(n: u32, d: u32) -> f64 {
    // The 53 bits of the quotient, and one for rounding.
    let (mut rest, mut bits, mut exponent) = (n, 0_u64, 1024 + 53);
    while bits >> 53 == 0 {
        // The next bit is one if twice the remainder reaches the divisor.
        let left = d - rest;
        let is_one = rest >= left;
        rest = if is_one { rest - left } else { rest + rest };
        bits = bits << 1 | u64::from(is_one);
        exponent -= 1_u32;
    }
    // No quotient is halfway between two doubles: a quotient that ends in binary has at most the 32 bits of `n`.
    // The highest bit of the mantissa adds one to the exponent.
    f64::from_bits((u64::from(exponent - 1) << 52) + ((bits + 1) >> 1))
}

#[cfg(test)]
mod tests {
    use super::{long_division, rem_euclid, twice_ratio_bit_by_bit};
    use std::vec::Vec;

    #[test]
    fn both_choices_give_the_same_bits() {
        let mut values: Vec<f64> = [0.0, -0.0, 0.5, -0.5, 1.5, 2.5, 4_503_599_627_370_497.5, 1e300, 5e-324].to_vec();
        let mut state = 1_u64;
        for _ in 0..200_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            values.push((state >> 40) as f64 / 64.0 - 1e5);
            values.push(f64::from_bits(state ^ (state >> 29)));
        }
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        for x in values {
            assert!(same(x.ceil(), libm::ceil(x)), "{x}");
            let (n, d) = ((x.to_bits() >> 32) as u32, (x.to_bits() as u32 >> 7).max(1));
            for (n, d) in
                [(n.min(d), n.max(d)), (n >> 27, d & 15), (n & 7, 8)].map(|(n, d)| (n.max(1), d.max(n).max(1) + 1))
            {
                assert!(same(twice_ratio_bit_by_bit(n, d), 2.0 * f64::from(n) / f64::from(d)), "{n} / {d}");
            }
            assert!(same(x.round(), libm::round(x)) && same(x.sqrt(), libm::sqrt(x)), "{x}");
            let single = x as f32;
            assert!(same(single.sqrt().into(), libm::sqrtf(single).into()), "{x}");
            if x.is_finite() {
                assert_eq!(rem_euclid(x, 360.0), x.rem_euclid(360.0), "{x}");
                for y in [360.0, 0.1, 1e300, 5e-324, 3e-310, f64::MIN_POSITIVE] {
                    // The longest take 2,000 subtractions: only some of them.
                    if (x.abs() / y) < 1e60 {
                        assert!(same(long_division(x, y), x % y), "{x} {y}");
                    }
                }
            }
        }
    }
}
