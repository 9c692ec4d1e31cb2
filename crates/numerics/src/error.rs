//! The argument error that all constructors share, and functions that check arguments and return it.

use thiserror::Error;

/// An argument that a constructor or function does not accept.
///
/// The message names the argument, shows its value and says what was expected, so that it can be shown to a user as it
/// stands. Crates above wrap it (`#[from]`) in their own error enum.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("argument `{name}` is {value}: expected {expected}")]
pub struct ArgumentError {
    /// Name of the argument as the signature spells it.
    pub name: &'static str,
    /// The value that was given, formatted.
    pub value: String,
    /// What is accepted, as a noun phrase (`a finite number`).
    pub expected: String,
}

impl ArgumentError {
    /// Builds the error from any printable value. A number that takes more than 24 characters is written with an exponent.
    #[cold]
    pub fn new(name: &'static str, value: impl std::fmt::Display, expected: impl Into<String>) -> Self {
        Self {
            name,
            value: short(value.to_string()),
            expected: expected.into(),
        }
    }
}

fn short(value: String) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.len() > 24 => format!("{number:e}"),
        _ => value,
    }
}

/// Returns an argument error as the error type of any crate: `Err(ArgumentError::new(name, value, expected).into())`.
pub fn refuse<T, E: From<ArgumentError>>(
    name: &'static str,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> Result<T, E> {
    Err(ArgumentError::new(name, value, expected).into())
}

/// Returns `value` if `accepted(value)` is true, and the error otherwise.
#[inline]
fn require(
    name: &'static str,
    value: f64,
    accepted: impl Fn(f64) -> bool,
    expected: &'static str,
) -> Result<f64, ArgumentError> {
    if accepted(value) {
        Ok(value)
    } else {
        Err(refused(name, value, expected))
    }
}

/// Not inlined, so that callers stay small enough to be inlined themselves.
#[cold]
#[inline(never)]
fn refused(name: &'static str, value: f64, expected: &str) -> ArgumentError {
    ArgumentError::new(name, value, expected)
}

#[cold]
#[inline(never)]
fn refused_range(name: &'static str, value: f64, low: f64, high: f64) -> ArgumentError {
    ArgumentError::new(name, value, format!("a number in [{low}, {high}]"))
}

/// Accepts any finite number.
#[inline]
pub fn finite(name: &'static str, value: f64) -> Result<f64, ArgumentError> {
    require(name, value, f64::is_finite, "a finite number")
}

/// Accepts finite numbers above zero.
#[inline]
pub fn positive(name: &'static str, value: f64) -> Result<f64, ArgumentError> {
    require(name, value, |v| v.is_finite() && v > 0.0, "a finite number above 0")
}

/// Accepts finite numbers from zero up.
#[inline]
pub fn non_negative(name: &'static str, value: f64) -> Result<f64, ArgumentError> {
    require(name, value, |v| v.is_finite() && v >= 0.0, "a finite number, 0 or above")
}

/// Accepts numbers in the closed interval `[low, high]`.
#[inline]
pub fn within(name: &'static str, value: f64, low: f64, high: f64) -> Result<f64, ArgumentError> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(refused_range(name, value, low, high))
    }
}

/// Accepts counts of at least one.
pub fn at_least_one(name: &'static str, value: usize) -> Result<usize, ArgumentError> {
    if value >= 1 {
        Ok(value)
    } else {
        Err(ArgumentError::new(name, value, "at least 1"))
    }
}

/// Accepts a list with as many entries as expected.
#[inline]
pub fn entries(name: &'static str, given: usize, expected: usize) -> Result<(), ArgumentError> {
    if given == expected {
        Ok(())
    } else {
        Err(ArgumentError::new(name, format!("{given} entries"), format!("{expected} entries")))
    }
}

/// Accepts slices whose entries are all finite.
#[inline]
pub fn all_finite(name: &'static str, values: &[f64]) -> Result<(), ArgumentError> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(ArgumentError::new(name, format!("{} at index {at}", values[at]), "finite numbers only")),
    }
}

/// Accepts a probability vector: entries in `[0, 1]` that sum to one within `1e-9`.
pub fn probabilities(name: &'static str, values: &[f64]) -> Result<(), ArgumentError> {
    if values.is_empty() {
        return Err(ArgumentError::new(name, "empty", "at least one probability"));
    }
    if let Some(at) = values.iter().position(|v| !(0.0..=1.0).contains(v)) {
        return Err(ArgumentError::new(name, format!("{} at index {at}", values[at]), "probabilities in [0, 1]"));
    }
    let sum: f64 = values.iter().sum();
    if (sum - 1.0).abs() > 1e-9 {
        return Err(ArgumentError::new(name, format!("a vector summing to {sum}"), "probabilities that sum to 1"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::ArgumentError;

    #[test]
    fn long_numbers_have_an_exponent_and_long_texts_stay() {
        let shown = |value: &dyn std::fmt::Display| ArgumentError::new("x", value, "a number").value;
        assert_eq!(shown(&1.5e300), "1.5e300");
        assert_eq!(shown(&-1e-320), format!("{:e}", -1e-320));
        assert_eq!(shown(&0.1), "0.1");
        let text = "a value of more than twenty-four characters";
        assert_eq!(shown(&text), text);
    }
}
