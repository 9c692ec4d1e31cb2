//! Claims: named predicates over the rows of a figure.
//!
//! A figure is not reproduced because it was drawn; it is reproduced because what the paper says about it was checked. Each
//! statement is a [`Claim`] with a measured value, what was expected of it, and the tolerance between. A claim of the paper
//! that is false becomes a claim of ours with the right sign and a pointer into `docs/errata.md`.
//!
//! A claim about nothing does not hold: a row that is not there, an empty selection, a value that is not finite fail it. (After
//! `--set` the rows of the paper's setting may rightly be absent: then the claim is skipped.)

mod compare;

pub use compare::{find, minus, over};

use crate::measured::Measured;
use crate::schema::Value;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;
use std::rc::Rc;

/// Whether a claim held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It held.
    Pass,
    /// It did not.
    Fail,
    /// It was not decided: it needs the full trial count, or the figure's own parameters.
    Skipped,
}

/// What was expected of a measured value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Expected {
    /// A number, within the claim's tolerance.
    Number(f64),
    /// A condition, such as `<= 2`.
    Condition(String),
}

impl Expected {
    fn of(condition: impl fmt::Display) -> Self {
        Self::Condition(condition.to_string())
    }
}

/// A statement about a figure, measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    /// Short name, unique within the figure.
    pub id: String,
    /// The statement in words.
    pub statement: String,
    /// Verdict.
    pub verdict: Verdict,
    /// What was measured; none where the row it speaks of is absent, or what is not finite.
    pub value: Option<f64>,
    /// What was expected of it.
    pub expected: Expected,
    /// Allowed deviation, where the expectation is a number.
    pub tolerance: Option<f64>,
}

/// A text, owned or not.
pub trait Text: Into<String> {}
impl<T: Into<String>> Text for T {}

/// A value that may be absent.
pub trait Maybe<T = f64>: Into<Option<T>> {}
impl<T, V: Into<Option<T>>> Maybe<T> for V {}

/// Values one after the other, any of which may be absent.
pub trait Series: IntoIterator<Item: Into<Option<f64>>> {}
impl<S: IntoIterator<Item: Into<Option<f64>>>> Series for S {}

macro_rules! comparisons {
    ($($name:ident $operator:tt),*) => {$(
        #[doc = concat!("`value ", stringify!($operator), " bound`.")]
        pub fn $name(&self, id: impl Text, statement: impl Text, value: impl Maybe, bound: f64) {
            let condition = Expected::of(format_args!(concat!(stringify!($operator), " {}"), bound));
            self.decide(id, statement, value.into(), condition, |v| v $operator bound);
        }
    )*};
}

/// The claims of one figure as they are made. Every method adds one claim (or one for each reference); those made through
/// [`Claims::at_defaults`] or [`Claims::at_full_trials`] are limited.
#[derive(Debug, Clone)]
pub struct Claims {
    figure: &'static str,
    made: Rc<RefCell<Vec<Claim>>>,
    /// The quantities of which references were looked at.
    compared: Rc<RefCell<BTreeSet<String>>>,
    erratum: Option<&'static str>,
    /// Whether a value may be below its reference by any amount.
    one_sided: bool,
    /// Whether what is claimed holds at the figure's own parameters only, and needs the full trial count.
    limits: [bool; 2],
    /// Whether the run has these parameters, and that count.
    run: [bool; 2],
}

impl Claims {
    /// No claims yet about a run of the figure of this id: whether its parameters were the defaults, and its trial counts full.
    pub fn about(figure: &'static str, defaults: bool, full_effort: bool) -> Self {
        Self {
            figure,
            made: Rc::default(),
            compared: Rc::default(),
            erratum: None,
            one_sided: false,
            limits: [false; 2],
            run: [defaults, full_effort],
        }
    }

    /// What is claimed through this is made for the figure's own parameters only; skipped after `--set`.
    pub fn at_defaults(&self) -> Self {
        let limits = [true, self.limits[1]];
        Self { limits, ..self.clone() }
    }

    /// What is claimed through this says at its end that it shows this erratum of `docs/errata.md`.
    pub(crate) fn showing(&self, erratum: &'static str) -> Self {
        Self {
            erratum: Some(erratum),
            ..self.clone()
        }
    }

    /// Less is better in what is claimed through this, and the other program is not known to be the best: no row is above its
    /// reference by more than the tolerance and four combined standard errors.
    pub fn no_more(&self) -> Self {
        Self {
            one_sided: true,
            ..self.clone()
        }
    }

    /// What is claimed through this can only be decided at the full trial count, skipped with fewer trials: what it compares is
    /// no plain average of trials.
    pub fn at_full_trials(&self) -> Self {
        let limits = [self.limits[0], true];
        Self { limits, ..self.clone() }
    }

    fn decide(
        &self,
        id: impl Text,
        statement: impl Text,
        value: Option<f64>,
        expected: Expected,
        holds: impl FnOnce(f64) -> bool,
    ) {
        // Where the parameters are not the defaults, what a claim speaks of may rightly be absent.
        let needed = [self.limits[0] || value.is_none(), self.limits[1]];
        let undecided = needed.iter().zip(self.run).any(|(needed, given)| *needed && !given);
        let verdict = match value {
            _ if undecided => Verdict::Skipped,
            Some(value) if value.is_finite() && holds(value) => Verdict::Pass,
            _ => Verdict::Fail,
        };
        let mut statement = statement.into();
        if let Some(erratum) = self.erratum {
            statement.push_str(&format!(" (erratum {erratum})"));
        }
        self.made.borrow_mut().push(Claim {
            id: id.into(),
            statement,
            verdict,
            value: value.filter(|value| value.is_finite()),
            expected,
            tolerance: None,
        });
    }

    /// Every row satisfies `holds`; the value is the number of rows that do not. No rows: nothing was shown.
    pub fn all<R>(
        &self,
        id: impl Text,
        statement: impl Text,
        rows: impl IntoIterator<Item = R>,
        holds: impl Fn(R) -> bool,
    ) {
        let (mut rows, mut broken) = (rows.into_iter().peekable(), 0.0);
        let any = rows.peek().is_some();
        for row in rows {
            broken += f64::from(u8::from(!holds(row)));
        }
        self.decide(id, statement, any.then_some(broken), Expected::of("0 violations"), |v| v == 0.0);
    }

    /// `|value - expected| <= tolerance`.
    pub fn near(&self, id: impl Text, statement: impl Text, value: impl Maybe, expected: f64, tolerance: f64) {
        let number = Expected::Number(expected);
        self.decide(id, statement, value.into(), number, |v| (v - expected).abs() <= tolerance);
        if let Some(claim) = self.made.borrow_mut().last_mut() {
            claim.tolerance = Some(tolerance);
        }
    }

    comparisons! { at_most <=, at_least >=, below <, above > }

    /// Each value is strictly smaller than the next; the value is the number of neighbours that are not. At least two values.
    pub fn increasing(&self, id: impl Text, statement: impl Text, values: impl Series) {
        let values: Option<Vec<f64>> = values.into_iter().map(Into::into).collect();
        let values = values.filter(|v| v.len() > 1);
        let broken = values.map(|v| v.windows(2).filter(|pair| !increases(pair[0], pair[1])).count() as f64);
        self.decide(id, statement, broken, Expected::of("0 violations"), |v| v == 0.0);
    }

    /// Each value is strictly larger than the next.
    pub fn decreasing(&self, id: impl Text, statement: impl Text, values: impl Series) {
        self.increasing(id, statement, values.into_iter().map(|v| v.into().map(|v: f64| -v)));
    }

    /// The estimate is within `errors` of its standard errors of `expected`; the value is its deviation in standard errors.
    pub fn within(
        &self,
        id: impl Text,
        statement: impl Text,
        estimate: impl Maybe<Measured>,
        expected: f64,
        errors: f64,
    ) {
        let z = estimate.into().and_then(|e| e.z_score(expected));
        let condition = format!("{} within {errors} standard errors", Value::Number(expected));
        self.decide(id, statement, z, Expected::Condition(condition), |z| z.abs() <= errors);
    }

    /// Every row's estimate is within `errors` of its standard errors of the row's expectation; the value is the largest
    /// deviation in standard errors.
    pub fn all_within<R>(
        &self,
        id: impl Text,
        statement: impl Text,
        rows: impl IntoIterator<Item = R>,
        pair: impl Fn(R) -> (Measured, f64),
        errors: f64,
    ) {
        let scores = rows
            .into_iter()
            .map(pair)
            .map(|(estimate, expected)| estimate.z_score(expected));
        let scores: Option<Vec<f64>> = scores.map(|z| z.map(f64::abs)).collect();
        // NaN must survive: `f64::max` would drop it.
        let worst = scores.and_then(|z| z.into_iter().reduce(|a, b| if a.is_nan() || a >= b { a } else { b }));
        self.decide(id, statement, worst, Expected::of(format_args!("<= {errors} standard errors")), |z| z <= errors);
    }

    /// The (paired) difference is negative by at least `errors` of its standard errors: the first is smaller than the second.
    pub fn less(&self, id: impl Text, statement: impl Text, difference: impl Maybe<Measured>, errors: f64) {
        let z = difference.into().and_then(|d| d.z_score(0.0));
        self.decide(id, statement, z, Expected::of(format_args!("< -{errors} standard errors")), |z| z < -errors);
    }

    /// All that were made.
    pub(crate) fn made(self) -> Vec<Claim> {
        self.made.take()
    }
}

/// Strictly, and false where either is not a number.
fn increases(a: f64, b: f64) -> bool {
    a < b
}

#[cfg(test)]
mod tests;
