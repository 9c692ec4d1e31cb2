//! Claims of the old idiom.

pub use crate::claim::{Expected, Verdict};
use serde::Serialize;

/// A statement about a figure, measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// Short name, unique within the figure.
    pub id: String,
    /// The statement in words.
    pub statement: String,
    /// Verdict.
    pub verdict: Verdict,
    /// What was measured.
    pub value: f64,
    /// What was expected of it.
    pub expected: Expected,
    /// Allowed deviation, where the expectation is a number.
    pub tolerance: Option<f64>,
    /// Holds only at the figure's own parameters.
    #[serde(skip)]
    pub(crate) at_defaults: bool,
    /// Can only be decided at the full trial count.
    #[serde(skip)]
    pub(crate) full_effort: bool,
}

impl Claim {
    fn decided(
        id: impl Into<String>,
        statement: impl Into<String>,
        value: f64,
        expected: Expected,
        holds: bool,
    ) -> Self {
        Self {
            id: id.into(),
            statement: statement.into(),
            verdict: if holds { Verdict::Pass } else { Verdict::Fail },
            value,
            expected,
            tolerance: None,
            at_defaults: false,
            full_effort: false,
        }
    }

    /// `|value - expected| <= tolerance`.
    pub fn near(
        id: impl Into<String>,
        statement: impl Into<String>,
        value: f64,
        expected: f64,
        tolerance: f64,
    ) -> Self {
        let holds = (value - expected).abs() <= tolerance;
        Self {
            tolerance: Some(tolerance),
            ..Self::decided(id, statement, value, Expected::Number(expected), holds)
        }
    }

    /// `|value / expected - 1| <= tolerance`.
    pub fn near_relative(
        id: impl Into<String>,
        statement: impl Into<String>,
        value: f64,
        expected: f64,
        tolerance: f64,
    ) -> Self {
        Self::near(id, statement, value, expected, tolerance * expected.abs())
    }

    /// `value <= bound`.
    pub fn at_most(id: impl Into<String>, statement: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::decided(id, statement, value, Expected::Condition(format!("<= {bound}")), value <= bound)
    }

    /// `value >= bound`.
    pub fn at_least(id: impl Into<String>, statement: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::decided(id, statement, value, Expected::Condition(format!(">= {bound}")), value >= bound)
    }

    /// `value < bound`.
    pub fn below(id: impl Into<String>, statement: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::decided(id, statement, value, Expected::Condition(format!("< {bound}")), value < bound)
    }

    /// `value > bound`.
    pub fn above(id: impl Into<String>, statement: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::decided(id, statement, value, Expected::Condition(format!("> {bound}")), value > bound)
    }

    /// No counterexample among those looked at: `violations` counts the rows that break the statement.
    pub fn never(id: impl Into<String>, statement: impl Into<String>, violations: usize) -> Self {
        Self::decided(id, statement, violations as f64, Expected::Condition("0 violations".to_owned()), violations == 0)
    }

    /// The claim is made for the figure's own parameters only; skipped after `--set`.
    #[must_use]
    pub fn at_defaults(self) -> Self {
        Self {
            at_defaults: true,
            ..self
        }
    }

    /// The claim can only be decided at the full trial count; skipped with fewer trials.
    #[must_use]
    pub fn needs_full_trials(self) -> Self {
        Self {
            full_effort: true,
            ..self
        }
    }

    pub(crate) fn judged(self, defaults: bool, full_effort: bool) -> Self {
        let undecided = (self.at_defaults && !defaults) || (self.full_effort && !full_effort);
        if undecided {
            Self {
                verdict: Verdict::Skipped,
                ..self
            }
        } else {
            self
        }
    }
}

/// Number of neighbours in `values` that do not increase strictly.
pub fn not_increasing(values: &[f64]) -> usize {
    values
        .windows(2)
        .filter(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less))
        .count()
}

/// Number of neighbours in `values` that do not decrease strictly.
pub fn not_decreasing(values: &[f64]) -> usize {
    values
        .windows(2)
        .filter(|pair| pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Less))
        .count()
}

/// Largest entry; `-inf` of nothing.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// Smallest entry; `+inf` of nothing.
pub fn smallest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}
