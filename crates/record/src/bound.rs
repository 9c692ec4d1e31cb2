//! The error bound of a column, and the test whether a restored value is within it.
//!
//! The test is exact. In rounded arithmetic `|a - b| <= delta` accepts differences that exceed `delta` by half a unit in the last place.
//! Here the rounding error of the difference decides if the rounded difference equals `delta`.

use fewbits_block_codec::{ArgumentError, ensure};

/// The error bound of a column, for every finite sample. Gaps, NaN and infinities are always restored exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Bound {
    /// Restored with the same 64 bits.
    Lossless,
    /// Restored within this distance, in units of the column.
    Absolute(f64),
    /// Restored within this share of the column's range. The range is that of the rows up to the sample's block, unless
    /// [`Column::with_range`](crate::Column::with_range) fixes it. It only grows, so the bound holds for the range of all rows too.
    ShareOfRange(f64),
    /// Numbers of at most this many decimals (up to 15) are restored exactly, others within half a unit of the last decimal.
    Decimals(u8),
    /// Restored within this share of each value's size, or within the floor where that is larger: a value `x` within
    /// `max(share |x|, floor)`.
    Relative {
        /// Share of the value's size, from [`MIN_SHARE`] to one half.
        share: f64,
        /// Bound of small values, in units of the column.
        floor: f64,
    },
}

/// Largest number of decimals of [`Bound::Decimals`].
pub const MAX_DECIMALS: u8 = 15;
/// Smallest share of [`Bound::Relative`].
pub const MIN_SHARE: f64 = 1e-6;

impl Bound {
    pub(crate) fn checked(self) -> Result<Self, ArgumentError> {
        match self {
            Self::Absolute(delta) => {
                ArgumentError::positive("bound", delta)?;
                ensure!((2.0 * delta).is_finite(), "bound", delta, "a number whose double is finite");
            }
            Self::ShareOfRange(share) => {
                ArgumentError::positive("bound", share)?;
                ensure!(share <= 1.0, "bound", share, "a share of the range, at most 1");
            }
            Self::Decimals(places) if places > MAX_DECIMALS => {
                return Err(ArgumentError::new("bound", places, "at most 15 decimals"));
            }
            Self::Relative { share, floor } => {
                ensure!((MIN_SHARE..=0.5).contains(&share), "bound", share, "a share of each value, from 1e-6 to 0.5");
                ArgumentError::positive("floor", floor)?;
                let expected = "a number whose quotient by the share is finite";
                ensure!((4.0 * floor / share).is_finite(), "floor", floor, expected);
            }
            Self::Lossless | Self::Decimals(_) => {}
        }
        Ok(self)
    }
}

/// Powers of ten that doubles represent exactly.
pub(crate) const TENS: [f64; 16] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// Half a unit of the last of these decimals.
pub(crate) fn half_unit(places: u8) -> f64 {
    0.5 / TENS.get(usize::from(places)).copied().unwrap_or(1.0)
}

/// The integer `j` with `j / 10^places == value`, if there is one below 2^53.
pub(crate) fn decimal(value: f64, places: u8) -> Option<i64> {
    let ten = *TENS.get(usize::from(places))?;
    let scaled = (value * ten).round();
    (scaled.abs() < 9e15 && scaled / ten == value).then_some(scaled as i64)
}

impl Bound {
    /// Whether `restored` is within the bound of `sample`; both are finite. Of a share the range must be known: nothing else is within it
    /// than the sample.
    pub(crate) fn holds(self, sample: f64, restored: f64, period: Option<f64>) -> bool {
        match self {
            Self::Lossless | Self::ShareOfRange(_) => sample.to_bits() == restored.to_bits(),
            Self::Absolute(delta) => match period {
                None => is_within(sample, restored, delta),
                Some(period) => is_within_on_circle(sample, restored, delta, period),
            },
            // The product may have been rounded up, which a bound must not be.
            Self::Relative { share, floor } => {
                is_within(sample, restored, (share * sample.abs()).next_down().max(floor))
            }
            Self::Decimals(places) => match decimal(sample, places) {
                Some(_) => sample == restored,
                None => is_within(sample, restored, half_unit(places)),
            },
        }
    }
}

/// `a - b` as a rounded difference and its rounding error, whose sum is exact (Knuth's two-sum) unless the difference overflows.
fn difference(a: f64, b: f64) -> (f64, f64) {
    let rounded = a - b;
    let of_b = a - rounded;
    let of_a = rounded + of_b;
    (rounded, (a - of_a) + (of_b - b))
}

/// Whether `|a - b| <= delta` exactly, as real numbers.
pub fn is_within(a: f64, b: f64, delta: f64) -> bool {
    let (rounded, error) = difference(a, b);
    let distance = rounded.abs();
    // The error's sign relative to the difference tells whether the real distance is beyond the rounded one.
    distance < delta || (distance == delta && error * rounded.signum() <= 0.0)
}

/// Whether `|a - b + k period| <= delta` for some integer `k`. Precondition: `b` in `[0, period)`.
///
/// Returns `false` if rounding could matter, so `true` is certain.
pub fn is_within_on_circle(a: f64, b: f64, delta: f64, period: f64) -> bool {
    // The remainder of a division is exact.
    let reduced = a % period;
    if is_within(reduced, b, delta) {
        return true;
    }
    let (rounded, error) = difference(reduced, b);
    [-2.0, -1.0, 1.0].into_iter().any(|turns| {
        let (sum, rest) = difference(rounded, turns * period);
        (sum + (rest + error)).abs().next_up() <= delta
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_test_sees_half_an_ulp() {
        // 1 + 2^-54 rounds to 1.
        let tiny = 2.0_f64.powi(-54);
        assert_eq!(1.0 - (-tiny), 1.0);
        assert!(!is_within(1.0, -tiny, 1.0) && !is_within(-1.0, tiny, 1.0));
        assert!(is_within(1.0, tiny, 1.0) && is_within(1.0, 0.0, 1.0) && is_within(0.0, -0.0, 5e-324));
        assert!(!is_within(f64::MAX, f64::MIN, f64::MAX) && !is_within(5e-324, -5e-324, 5e-324));
    }

    #[test]
    fn circles_close() {
        for (a, b) in [(359.9, 0.05), (-0.1, 359.95), (720.1, 0.0), (0.05, 359.9)] {
            assert!(is_within_on_circle(a, b, 0.16, 360.0), "{a} {b}");
            assert!(!is_within_on_circle(a, b, 0.04, 360.0), "{a} {b}");
        }
    }

    #[test]
    fn decimals_are_found() {
        assert_eq!((decimal(22.482, 3), decimal(22.482, 2), decimal(-0.1, 1)), (Some(22_482), None, Some(-1)));
        assert!(Bound::Decimals(1).holds(0.26, 0.3, None) && !Bound::Decimals(1).holds(0.2, 0.21, None));
    }
}
