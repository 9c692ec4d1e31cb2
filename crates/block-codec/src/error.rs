//! Errors: arguments that are refused, and bytes that no writer wrote.

/// Returns an error, as the function's own, unless a condition holds: of a name, a value and what is expected an [`ArgumentError`]. It is made only
/// then.
#[doc(hidden)]
#[macro_export]
macro_rules! ensure {
    ($holds:expr, $error:expr) => {
        if $holds {
        } else {
            return Err($error.into());
        }
    };
    ($holds:expr, $name:expr, $value:expr, $expected:expr) => {
        $crate::ensure!($holds, $crate::ArgumentError::new($name, $value, $expected))
    };
}
pub(crate) use ensure;

/// An argument that a constructor or function does not accept. The message can be shown to a user as it stands.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
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

    /// Accepts finite numbers.
    ///
    /// # Errors
    /// If `value` is infinite or NaN.
    pub fn finite(name: &'static str, value: f64) -> Result<f64, Self> {
        ensure!(value.is_finite(), Self::new(name, value, "a finite number"));
        Ok(value)
    }

    /// Accepts finite numbers above zero.
    ///
    /// # Errors
    /// If `value` is infinite, NaN, or not above zero.
    pub fn positive(name: &'static str, value: f64) -> Result<f64, Self> {
        ensure!(value.is_finite() && value > 0.0, Self::new(name, value, "a finite number above 0"));
        Ok(value)
    }
}

fn short(value: String) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.len() > 24 => format!("{number:e}"),
        _ => value,
    }
}

/// Bytes that are not what a writer writes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` is {value}: expected {expected}")]
pub struct Damaged {
    /// Name of the field of the format.
    pub field: &'static str,
    /// What was found.
    pub value: String,
    /// What a writer writes there.
    pub expected: &'static str,
}

impl Damaged {
    /// Builds the error from any printable value. A number that takes more than 24 characters is written with an exponent.
    #[cold]
    pub fn new(field: &'static str, value: impl std::fmt::Display, expected: &'static str) -> Self {
        Self {
            field,
            value: value.to_string(),
            expected,
        }
    }
}

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Bytes that are not what a writer writes.
    #[error(transparent)]
    Damaged(#[from] Damaged),
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }
}

impl From<crate::bytes::Unread> for Damaged {
    fn from(error: crate::bytes::Unread) -> Self {
        Self::new("bytes", error, "the bytes that a writer writes")
    }
}

impl From<crate::bytes::Unread> for Error {
    fn from(error: crate::bytes::Unread) -> Self {
        Self::Damaged(error.into())
    }
}
