//! The error type of all sensor halves.

use core::fmt;

/// An invalid argument of a sensor's half, whose state is then unchanged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Error {
    /// Name of the argument in the function's signature.
    pub name: &'static str,
    /// The invalid value.
    pub value: f64,
    /// Description of the accepted values.
    pub expected: &'static str,
}

impl Error {
    #[cold]
    pub(crate) const fn new(name: &'static str, value: f64, expected: &'static str) -> Self {
        Self { name, value, expected }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "argument `{}` is {}: expected {}", self.name, self.value, self.expected)
    }
}

impl core::error::Error for Error {}

#[cfg(feature = "std")]
impl From<Error> for fewbits_numerics::ArgumentError {
    fn from(error: Error) -> Self {
        Self::new(error.name, error.value, error.expected)
    }
}

pub(crate) const fn finite(name: &'static str, value: f64) -> Result<f64, Error> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::new(name, value, "a finite number"))
    }
}

pub(crate) const fn positive(name: &'static str, value: f64) -> Result<f64, Error> {
    // Compared by bits (from the smallest positive number to the largest), because comparing doubles is a library call in software.
    if value.to_bits().wrapping_sub(1) < f64::MAX.to_bits() {
        Ok(value)
    } else {
        Err(Error::new(name, value, "a finite number above 0"))
    }
}
