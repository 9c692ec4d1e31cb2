//! Claims: named predicates over the rows of a figure.
//!
//! A figure is not reproduced because it was drawn; it is reproduced because what the paper says about it was checked. Each
//! statement is a [`Claim`] with a measured value, what was expected of it, and the tolerance between. A claim of the paper
//! that is false becomes a claim of ours with the right sign and a pointer into `docs/errata.md`.
//!
//! A claim about nothing does not hold: a row that is not there, an empty selection, a value that is not finite fail it. (After
//! `--set` the rows of the paper's setting may rightly be absent: then the claim is skipped.)

use crate::measured::Measured;
use crate::reference;
use crate::schema::{Table, Value};
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

    /// One claim for each reference `<figure>/<quantity>/<key>`: the row of that key has that value, within the reference's
    /// tolerance or, where it has a standard error, within four combined standard errors. A reference whose row is absent
    /// fails. References hold at the paper's setting only.
    pub fn references<R, V: Cell>(
        &self,
        quantity: &str,
        statement: &str,
        rows: impl IntoIterator<Item = R>,
        key_and_value: impl Fn(R) -> (String, V),
    ) {
        self.compared.borrow_mut().insert(quantity.to_owned());
        let rows: Vec<_> = rows.into_iter().map(key_and_value).collect();
        let known = match reference::group(self.figure, quantity) {
            Ok(known) if !known.is_empty() => known,
            Ok(_) => {
                let empty = "there are references of that name";
                self.at_least(format!("{quantity}-references"), empty, 0.0, 1.0);
                return;
            }
            Err(error) => {
                self.decide(format!("{quantity}-references"), error, None, Expected::of("to be read"), |_| false);
                return;
            }
        };
        let here = self.at_defaults();
        for (key, known) in known {
            let found = rows.iter().find(|(name, _)| name == key);
            let found = found.and_then(|(_, value)| value.measured());
            let own = found.and_then(|found| found.standard_error).unwrap_or(0.0);
            let tolerance = known.tolerance + 4.0 * known.standard_error.unwrap_or(0.0).hypot(own);
            let id = format!("{quantity}/{key}").replace(' ', "-");
            let statement = format!("{statement}, {key}");
            let number = found.map(|found| found.value);
            if self.one_sided {
                let statement = format!("{statement}: no more than the reference {}", known.value);
                here.at_most(id, statement, number, known.value + tolerance);
            } else {
                here.near(id, statement, number, known.value, tolerance);
            }
        }
    }

    /// As [`Claims::references`], of rows that name their own keys.
    pub fn keyed<'r, R: Keyed + 'r, V: Cell>(
        &self,
        quantity: &str,
        statement: &str,
        rows: impl IntoIterator<Item = &'r R>,
        value: impl Fn(&R) -> V,
    ) {
        self.references(quantity, statement, rows, |row| (row.key(), value(row)));
    }

    /// The references of this quantity stand in a column beside ours, and are not met: nothing is compared with them.
    pub fn shown(&self, quantity: &str) {
        self.compared.borrow_mut().insert(quantity.to_owned());
    }

    /// Compares each column of keyed rows that has references under its own name, unless the figure did so itself. References that
    /// nothing was compared with fail.
    pub(crate) fn compare(&self, tables: &[Table]) {
        let quantities = reference::quantities(self.figure).unwrap_or_default();
        let open: Vec<&str> = {
            let compared = self.compared.borrow();
            quantities
                .into_iter()
                .filter(|quantity| !compared.contains(*quantity))
                .collect()
        };
        for quantity in open {
            let column = |table: &Table| {
                table
                    .columns
                    .iter()
                    .position(|column| column.name == quantity.replace('-', "_"))
            };
            let keyed = |table: &&Table| table.keys.iter().any(Option::is_some) && column(table).is_some();
            let Some((table, i)) = tables
                .iter()
                .find(keyed)
                .and_then(|table| Some((table, column(table)?)))
            else {
                let what =
                    format!("the references `{quantity}` are compared with a column of that name, or by a claim");
                self.at_defaults()
                    .at_least(format!("{quantity}-references"), what, 0.0, 1.0);
                continue;
            };
            let number = |value: Option<&Value>| match value {
                Some(Value::Number(number)) => Some(*number),
                Some(Value::Integer(count)) => Some(*count as f64),
                _ => None,
            };
            let has_error = table
                .columns
                .get(i + 1)
                .is_some_and(|next| next.name == format!("{}_se", table.columns[i].name));
            let cells = table.keys.iter().zip(&table.rows).map(|(key, row)| {
                let error = if has_error { number(row.get(i + 1)) } else { None };
                (key.clone().unwrap_or_default(), number(row.get(i)).map(|value| Measured::new(value, error)))
            });
            let statement = table.columns[i].meaning.trim_end_matches('.');
            self.references(quantity, statement, cells, |cell| cell);
        }
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

/// A row that is found by a name: what follows the quantity in the keys of its references. `rows!` writes it.
pub trait Keyed {
    /// The name.
    fn key(&self) -> String;
}

/// What a reference can be compared with: a number, perhaps missing, perhaps with a standard error.
pub trait Cell {
    /// The number with its standard error.
    fn measured(&self) -> Option<Measured>;
}

impl Cell for f64 {
    fn measured(&self) -> Option<Measured> {
        Some(Measured::new(*self, None))
    }
}

impl Cell for Measured {
    fn measured(&self) -> Option<Measured> {
        Some(*self)
    }
}

/// The first number over the second, where both are there.
pub fn over(first: impl Cell, second: impl Cell) -> Option<f64> {
    Some(first.measured()?.value / second.measured()?.value)
}

/// The first number minus the second, where both are there.
pub fn minus(first: impl Cell, second: impl Cell) -> Option<f64> {
    Some(first.measured()?.value - second.measured()?.value)
}

impl<T: Cell> Cell for Option<T> {
    fn measured(&self) -> Option<Measured> {
        self.as_ref()?.measured()
    }
}

#[cfg(test)]
mod tests;
