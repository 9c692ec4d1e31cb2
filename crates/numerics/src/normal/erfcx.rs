//! The scaled complementary error function.

use libm::{erfc, exp};

const SQRT_PI: f64 = 1.772_453_850_905_516;

/// Below this argument `2 exp(x^2) - erfcx(-x)` overflows.
const OVERFLOW_EDGE: f64 = -26.6;

/// Where the rational approximation in `x` hands over to the one in `1/x^2`.
const SPLIT: f64 = 4.0;

// Rational interpolation of erfcx at Chebyshev nodes of [0, 4], computed with 60 digits; relative error 3e-18.
const NEAR_NUMERATOR: [f64; 10] = [
    1.0,
    2.0125116238222476,
    2.0250526398262245,
    1.2953377779505966,
    0.572968391173309,
    0.18059481479517173,
    0.040472062085315695,
    0.006224081197699236,
    0.0005983495077563341,
    2.7608292855081715e-05,
];
const NEAR_DENOMINATOR: [f64; 11] = [
    1.0,
    3.1408907909177595,
    4.569168374419992,
    4.062454169743386,
    2.4505324922372105,
    1.0508957764329967,
    0.32558758111476654,
    0.07226512715991351,
    0.011056364328556768,
    0.0010605468753260132,
    4.89344252064207e-05,
];

// The same for sqrt(pi) x erfcx(x) as a function of 1/x^2 on [0, 1/16]; relative error 4e-17.
const FAR_NUMERATOR: [f64; 6] = [
    1.0,
    21.43465733584908,
    146.3359989699445,
    368.2018417311306,
    289.7474533313427,
    32.07366682431021,
];
const FAR_DENOMINATOR: [f64; 6] = [
    1.0,
    21.934657335848947,
    156.553327637958,
    431.90251252429334,
    422.8486998035103,
    98.69338018994513,
];

/// Horner's scheme on even and odd powers apart: two short chains run side by side. All coefficients here are positive.
#[inline]
pub(super) fn polynomial<const N: usize>(coefficients: &[f64; N], x: f64) -> f64 {
    let square = x * x;
    let (mut even, mut odd) = (0.0, 0.0);
    for pair in (0..N.div_ceil(2)).rev() {
        even = even * square + coefficients[2 * pair];
        odd = odd * square
            + if 2 * pair + 1 < N {
                coefficients[2 * pair + 1]
            } else {
                0.0
            };
    }
    odd * x + even
}

/// `erfcx(x) = exp(x^2) erfc(x)`, to about two units in the last place.
///
/// Positive and decreasing; `+inf` below `x = -26.6`, `~ 1/(x sqrt(pi))` for large `x`. NaN in, NaN out.
#[inline]
pub fn erfcx(x: f64) -> f64 {
    if x >= SPLIT {
        let u = 1.0 / (x * x);
        polynomial(&FAR_NUMERATOR, u) / (polynomial(&FAR_DENOMINATOR, u) * x * SQRT_PI)
    } else if x >= 0.0 {
        polynomial(&NEAR_NUMERATOR, x) / polynomial(&NEAR_DENOMINATOR, x)
    } else if x < OVERFLOW_EDGE {
        f64::INFINITY
    } else {
        exp(x * x) * erfc(x)
    }
}
