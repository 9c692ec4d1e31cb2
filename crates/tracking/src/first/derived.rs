//! Columns that are computed from others: a mean, the values behind a filter, the same in another unit. They measure nothing of their own.
//!
//! ```text
//! value(t) = a + sum of b_i times the other columns' values(t) + c times its own last value,  b_i, c >= 0
//! derived    if that holds within the rounding of all of them, while the values change by far more
//! ```
//! Of two columns of which each follows from the other the one behind is left out, and of a value and its change from row to row (c = 1) the change.

use crate::first::groups::{present, whole};
use crate::first::values::values_of;
use crate::rows::instant::Instant;
use crate::text;
use fewbits_table::names::as_argument;
use nalgebra::{DMatrix, DVector};

/// Rows with values of all columns, at least; of more columns than this nothing is asked.
const FEWEST: usize = 60;
const MOST: usize = 16;
/// Share of the rows in which the equation holds, if last values are in it; otherwise it holds in all.
const NEARLY_ALL: f64 = 0.98;
/// Values change by so many times what the equation may be off.
const FAR_MORE: f64 = 10.0;
/// Most decimals, and the rounding of numbers that have more, as a share of the largest.
const DECIMALS: i32 = 9;
const EXACT: f64 = 1e-9;
/// Slack of the rounding, and shares of the deviation below this are none.
const SLACK: f64 = 1.05;
const NO_SHARE: f64 = 0.02;
/// The share of the last value in a sum of changes, but for rounding.
const WHOLE: f64 = 0.99;

/// What a column is computed from.
#[derive(Debug)]
pub(crate) struct Derived {
    column: usize,
    from: Vec<usize>,
    /// It is the change of that column from row to row.
    is_change: bool,
}

struct Column {
    values: Vec<f64>,
    /// Half of its step.
    rounding: f64,
}

impl Column {
    fn new(values: Vec<f64>) -> Self {
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let is_multiple = |unit: &f64| {
            values
                .iter()
                .all(|value| (value / unit - (value / unit).round()).abs() < 1e-6)
        };
        let mut units = (0..=DECIMALS).map(|decimals| 10_f64.powi(-decimals));
        let rounding = 0.5 * units.find(is_multiple).unwrap_or(0.0).max(EXACT * largest);
        Self { values, rounding }
    }

    /// The values but the first, or but the last, about their mean.
    fn centred(values: &[f64]) -> DVector<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        DVector::from_iterator(values.len(), values.iter().map(|value| value - mean))
    }
}

fn middle(numbers: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    let at = ((share * numbers.len() as f64) as usize).min(numbers.len().saturating_sub(1));
    numbers.get(at).copied().unwrap_or(f64::INFINITY)
}

/// The places of those from which a column is computed, itself among them if its last value is, and whether it adds them up from row to row.
fn sources(columns: &[Column], column: usize, others: &[usize], with_own: bool) -> Option<(Vec<usize>, bool)> {
    let own = &columns[column];
    let behind = |one: &Column| Column::centred(&one.values[1..]);
    let target = behind(own);
    let last = Column::centred(&own.values[..own.values.len() - 1]);
    let places: Vec<usize> = others.iter().copied().chain(with_own.then_some(column)).collect();
    let of = |place: &usize| {
        if *place == column {
            last.clone()
        } else {
            behind(&columns[*place])
        }
    };
    let matrix = DMatrix::from_columns(&places.iter().map(of).collect::<Vec<_>>());
    let decomposed = matrix.clone().svd(true, true);
    let factors = decomposed
        .solve(&target, EXACT * decomposed.singular_values.max())
        .ok()?;
    let parts = places.iter().zip(&factors);
    let allowed =
        SLACK * parts.fold(own.rounding, |sum, (place, factor)| sum + factor.abs() * columns[*place].rounding);
    // Behind an empty cell the last value is not that of the row before.
    let share_of_rows = if with_own { NEARLY_ALL } else { 1.0 };
    let off = &target - &matrix * &factors;
    let steps = own.values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let holds =
        middle(off.iter().map(|off| off.abs()), share_of_rows) <= allowed && middle(steps, 0.5) >= FAR_MORE * allowed;
    let share = |i: usize| factors[i] * matrix.column(i).norm() / target.norm();
    let is_positive = (0..places.len()).all(|i| share(i) > -NO_SHARE);
    let is_sum = with_own && factors[others.len()] > WHOLE;
    let has_share = (0..places.len()).filter(|i| share(*i) > NO_SHARE);
    (holds && is_positive).then(|| (has_share.map(|i| places[i]).collect(), is_sum))
}

/// Columns that are computed from those that remain.
pub(crate) fn derived(first: &[Instant], sensors: usize) -> Vec<Derived> {
    let mut remaining = present(first, sensors);
    let whole = whole(first, &remaining);
    if !(2..=MOST).contains(&remaining.len()) || whole.len() < FEWEST {
        return Vec::new();
    }
    let columns: Vec<Column> = (0..sensors)
        .map(|sensor| Column::new(values_of(&whole, sensor)))
        .collect();
    let mut found = Vec::new();
    for column in remaining.clone().into_iter().rev() {
        if !remaining.contains(&column) {
            continue;
        }
        let others: Vec<usize> = remaining.iter().copied().filter(|other| *other != column).collect();
        if others.is_empty() {
            break;
        }
        let from = [false, true]
            .iter()
            .find_map(|with_own| sources(&columns, column, &others, *with_own));
        let Some((from, is_sum)) = from else { continue };
        let added: Vec<usize> = from.iter().copied().filter(|other| *other != column).collect();
        let (column, from, is_change) = match added.as_slice() {
            [change] if is_sum => (*change, vec![column], true),
            _ => (column, from, false),
        };
        remaining.retain(|other| *other != column);
        found.push(Derived {
            column,
            from,
            is_change,
        });
    }
    found
}

impl Derived {
    pub(crate) fn column(&self) -> usize {
        self.column
    }

    pub(crate) fn hint(&self, names: &[String]) -> String {
        let name = text::name(&names[self.column]);
        let of = |place: &usize| match *place == self.column {
            true => "its own last value".to_owned(),
            false => text::name(&names[*place]).into_owned(),
        };
        let from: Vec<String> = self.from.iter().map(of).collect();
        let how = if self.is_change {
            "is the change from row to row of"
        } else {
            "follows from"
        };
        format!(
            "{name} {how} {}, to the last digit: it says nothing of its own and is left out, as --without {} does; --noise, --change and --prior \
             together keep it",
            from.join(", "),
            as_argument([&name])
        )
    }
}
