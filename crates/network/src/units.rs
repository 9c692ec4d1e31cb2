//! Quantities with units. The types prevent mixing bits, joules, seconds and watts.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::non_negative;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

/// A number of bits. Sums saturate at the largest number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Bits(pub u64);

/// Index of a node in the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SensorId(pub u32);

impl SensorId {
    /// The index as a `usize`.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Energy in joules, finite and not negative.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Joules(f64);

/// A duration in seconds, finite and not negative.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Seconds(f64);

/// Power in watts, finite and not negative.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Watts(f64);

/// Implements constructor, sums and display of a quantity.
macro_rules! quantity_operations {
    ($name:ident, $unit:literal) => {
        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(0.0);

            /// A value in the unit of the type.
            ///
            /// # Errors
            /// If `value` is negative or not finite.
            pub fn new(value: f64) -> Result<Self, ArgumentError> {
                non_negative($unit, value).map(Self)
            }

            /// A quantity that the caller knows to be finite and not negative.
            pub(crate) const fn trusted(value: f64) -> Self {
                Self(value)
            }

            /// The number, in the unit of the type.
            pub const fn value(self) -> f64 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = ArgumentError;

            fn try_from(value: f64) -> Result<Self, ArgumentError> {
                Self::new(value)
            }
        }

        impl From<$name> for f64 {
            fn from(quantity: $name) -> f64 {
                quantity.0
            }
        }

        impl Add for $name {
            type Output = Self;

            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        /// The difference; zero if it would be negative.
        impl Sub for $name {
            type Output = Self;

            fn sub(self, other: Self) -> Self {
                Self((self.0 - other.0).max(0.0))
            }
        }

        impl Sum for $name {
            fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
                all.fold(Self::ZERO, Add::add)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{} {}", self.0, $unit)
            }
        }
    };
}

quantity_operations!(Joules, "J");
quantity_operations!(Seconds, "s");
quantity_operations!(Watts, "W");

impl Mul<Seconds> for Watts {
    type Output = Joules;

    fn mul(self, duration: Seconds) -> Joules {
        Joules(self.0 * duration.0)
    }
}

impl Add for Bits {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl AddAssign for Bits {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<u64> for Bits {
    type Output = Self;

    fn mul(self, times: u64) -> Self {
        Self(self.0.saturating_mul(times))
    }
}

impl Sum for Bits {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self(0), Add::add)
    }
}

impl fmt::Display for Bits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bit", self.0)
    }
}

impl fmt::Display for SensorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}", self.0)
    }
}

/// A point of simulated time, in nanoseconds. Integers make ties equal on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Instant(pub u64);

impl Instant {
    /// The instant later by `duration`, rounded to nanoseconds and at most the largest instant.
    #[must_use]
    pub fn after(self, duration: Seconds) -> Self {
        Self(self.0.saturating_add((duration.0 * 1e9).round() as u64))
    }

    /// Time since the start.
    pub fn since_start(self) -> Seconds {
        Seconds(self.0 as f64 * 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_finite_and_never_negative() {
        assert!(Joules::new(-1.0).is_err() && Seconds::new(f64::NAN).is_err() && Watts::new(f64::INFINITY).is_err());
        let (one, two) = (Joules::new(1.0).unwrap(), Joules::new(2.0).unwrap());
        assert_eq!((one - two, two - one, one + one), (Joules::ZERO, one, two));
        assert_eq!(Watts::new(2.0).unwrap() * Seconds::new(0.5).unwrap(), one);
        assert!(serde_json::from_str::<Joules>("-1").is_err());
        assert_eq!(Bits(u64::MAX) + Bits(1), Bits(u64::MAX));
    }

    #[test]
    fn time_saturates() {
        let late = Instant(5).after(Seconds::new(1e300).unwrap());
        assert_eq!(late, Instant(u64::MAX));
        assert_eq!(Instant(0).after(Seconds::new(1.5).unwrap()), Instant(1_500_000_000));
    }
}
