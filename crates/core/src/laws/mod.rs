//! The laws of this crate's traits, to be called from a test of every implementation.
//!
//! Each function checks one law and returns a [`Violation`] that says what was expected and what was found. Laws about
//! frequencies take a random stream and accept four standard errors: with a fixed seed they pass always or never.

pub mod belief;
pub mod dynamics;
pub mod evolution;
pub mod factor;
pub mod likelihood;
pub mod message;
pub mod scheme;
pub mod sensing;

/// A law that an implementation breaks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{law}: {found}, expected {expected}")]
pub struct Violation {
    /// The law.
    pub law: &'static str,
    /// What was found, and where.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl Violation {
    fn new(law: &'static str, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Self {
        Self {
            law,
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }
}

/// Standard errors that a frequency or an average may be off.
const STANDARD_ERRORS: f64 = 4.0;

/// An error of the implementation under test is a violation, too.
fn failed<T>(law: &'static str, result: Result<T, impl std::fmt::Display>) -> Result<T, Violation> {
    result.map_err(|error| Violation::new(law, error, "no error"))
}

/// Compares two numbers that must agree to `tolerance`, relative to the larger of `scale` and the expected.
fn agree(
    law: &'static str,
    at: impl std::fmt::Display,
    found: f64,
    expected: f64,
    tolerance: f64,
    scale: f64,
) -> Result<(), Violation> {
    let same = found == expected || (found - expected).abs() <= tolerance * expected.abs().max(scale);
    if same {
        Ok(())
    } else {
        Err(Violation::new(law, format!("{found} at {at}"), expected))
    }
}

/// Mean and standard error of draws.
struct Average {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Average {
    fn new() -> Self {
        Self {
            count: 0.0,
            mean: 0.0,
            squares: 0.0,
        }
    }

    fn add(&mut self, x: f64) {
        self.count += 1.0;
        let delta = x - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (x - self.mean);
    }

    /// Whether the average is within [`STANDARD_ERRORS`] of `expected`; `slack` forgives rounding.
    fn check(&self, law: &'static str, at: impl std::fmt::Display, expected: f64, slack: f64) -> Result<(), Violation> {
        let error = (self.squares / (self.count - 1.0).max(1.0) / self.count).sqrt();
        if (self.mean - expected).abs() <= STANDARD_ERRORS * error + slack {
            Ok(())
        } else {
            Err(Violation::new(law, format!("{} +- {error} at {at}", self.mean), expected))
        }
    }
}
