//! Whole numbers of 64 bits as the doubles of a column.
//!
//! A cell is a double, and a double holds 53 bits. So a column of whole numbers has *codes*: the distance from the column's origin where it
//! is at most `2^53`, and otherwise a double with the distance's own bits. Each code stands for one number and each number has one code;
//! a column without loss returns the code's bits, so it returns the number.

/// The largest distance from the origin that is its own code.
const NEAR: i64 = 1 << 53;
/// Whole doubles below this are numbers of 64 bits.
const MOST: f64 = 9_223_372_036_854_775_808.0;

/// How the codes of a column stand for whole numbers.
///
/// ```
/// use fewbits_record::Integers;
///
/// let numbers = Integers::from_origin(1_700_000_000_123_456_789);
/// assert_eq!(numbers.code(1_700_000_000_123_456_799), 10.0);
/// for number in [i64::MIN, -1, 0, 1 << 60, i64::MAX] {
///     assert_eq!(numbers.number(numbers.code(number)), number);
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Integers {
    origin: i64,
}

/// The distance that a double is the code of, if it is a near one.
fn near(code: f64) -> Option<i64> {
    let is_near = code.fract() == 0.0 && code.abs() <= NEAR as f64 && code.to_bits() != (-0.0_f64).to_bits();
    is_near.then_some(code as i64)
}

impl Integers {
    /// Codes are distances from this number. Numbers near it take few bits.
    pub fn from_origin(origin: i64) -> Self {
        Self { origin }
    }

    /// The number that code 0 stands for.
    pub fn origin(self) -> i64 {
        self.origin
    }

    /// The code of a number.
    pub fn code(self, number: i64) -> f64 {
        let distance = number.wrapping_sub(self.origin);
        if distance.unsigned_abs() <= NEAR.unsigned_abs() {
            return distance as f64;
        }
        // A double of these bits may be the code of a near distance. The double of that distance's bits is then free: it is below the
        // smallest normal double, or not finite, or beyond all near ones.
        let code = f64::from_bits(distance.cast_unsigned());
        near(code).map_or(code, |taken| f64::from_bits(taken.cast_unsigned()))
    }

    /// The code of a number that a double holds; `None` if it is no whole number of 64 bits.
    pub fn code_of(self, number: f64) -> Option<f64> {
        let is_whole = number.fract() == 0.0 && (-MOST..MOST).contains(&number);
        is_whole.then(|| self.code(number as i64))
    }

    /// The number of a code: any double is one.
    pub fn number(self, code: f64) -> i64 {
        let bits = code.to_bits().cast_signed();
        let distance = match near(code) {
            Some(distance) => distance,
            None if bits.unsigned_abs() <= NEAR.unsigned_abs() => (bits as f64).to_bits().cast_signed(),
            None => bits,
        };
        self.origin.wrapping_add(distance)
    }
}
