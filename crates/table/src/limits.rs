//! Cells that say only on which side of a number the measurement is: `<0.25`, `> 40`, as laboratories write what is below or above a limit.

use crate::column::{Batch, Cells, Kind, Side};
use crate::number::{self, Number, Syntax};
use crate::profile::Profile;
use crate::survey::Survey;
use crate::table::Table;

/// The number of such a cell, and its side.
pub(crate) fn parse(text: &str, syntax: Syntax) -> Option<(f64, Side)> {
    let text = text.trim();
    let (side, rest) = match text.strip_prefix(['<', '≤']) {
        Some(rest) => (Side::Below, rest),
        None => (Side::Above, text.strip_prefix(['>', '≥'])?),
    };
    let rest = rest.strip_prefix('=').unwrap_or(rest).trim_start();
    match number::parse(rest.as_bytes(), syntax) {
        Ok(Number::Double(value, _)) if value.is_finite() => Some((value, side)),
        _ => None,
    }
}

/// Whether the first cell of a column that is no number is such a cell, and the column has no words.
fn has_limits(profile: &Profile, syntax: Syntax) -> bool {
    let is_limit = |text: &str| parse(text, syntax).is_some();
    let is_number = |text: &String| is_limit(text) || number::parse(text.as_bytes(), syntax).is_ok();
    let begins = profile.first_text.as_ref().is_some_and(|(_, text)| is_limit(text));
    begins && (profile.kind() == Kind::Number || profile.words.keys().all(is_number))
}

impl Table {
    /// Takes cells as `<0.25` and `>40` for numbers, in the columns that have them: [`Batch::limits`] says on which side of it the measurement is.
    /// `survey`: what reading the table once has shown; without it, what the first rows have. Returns whether there are such columns.
    pub fn take_limits(&mut self, survey: Option<&Survey>) -> bool {
        let profiles = survey.map_or(&self.profiles, |survey| &survey.columns);
        self.has_limits = profiles.iter().map(|one| has_limits(one, self.syntax)).collect();
        let columns = self.columns.iter_mut().zip(&self.has_limits);
        columns
            .filter(|(_, has_limits)| **has_limits)
            .for_each(|(column, _)| column.kind = Kind::Number);
        self.has_limits.contains(&true)
    }

    /// Takes a cell of the present row that is no number. Returns whether it is such a cell.
    pub(crate) fn push_limit(&self, batch: &mut Batch, index: usize, column: usize) -> bool {
        let is_expected = self.has_limits.get(column).copied().unwrap_or(false);
        let found = parse(self.row.cell_text(column), self.syntax).filter(|_| is_expected);
        let (Some((value, side)), Some(Cells::Numbers(numbers))) = (found, batch.columns.get_mut(index)) else {
            return false;
        };
        numbers.push(Some(value));
        batch.limits.push((index, batch.rows, side));
        true
    }
}
