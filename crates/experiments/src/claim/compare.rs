//! Comparison with references: of columns without a word, of other values by name.

use super::{Claims, Expected};
use crate::measured::Measured;
use crate::reference;
use crate::schema::{Field, Table};
use fewbits_plot::Mark;

impl Claims {
    /// One claim for each reference `<figure>/<quantity>/<key>`: the row of that key has that value, within the reference's
    /// tolerance or, where it has a standard error, within four combined standard errors. A reference whose row is absent
    /// fails. References hold at the paper's setting only.
    pub fn references<R, V: Mark>(
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
            let (number, own) = found.and_then(|(_, value)| value.mark()).unzip();
            let tolerance = known.tolerance + 4.0 * known.standard_error.unwrap_or(0.0).hypot(own.unwrap_or(0.0));
            let id = format!("{quantity}/{key}").replace(' ', "-");
            let statement = format!("{statement}, {key}");
            if self.one_sided {
                let statement = format!("{statement}: no more than the reference {}", known.value);
                here.at_most(id, statement, number, known.value + tolerance);
            } else {
                here.near(id, statement, number, known.value, tolerance);
            }
        }
    }

    /// As [`Claims::references`], of rows that name their own keys.
    pub fn keyed<'r, R: Field + 'r, V: Mark>(
        &self,
        quantity: &str,
        statement: &str,
        rows: impl IntoIterator<Item = &'r R>,
        value: impl Fn(&R) -> V,
    ) {
        self.references(quantity, statement, rows, |row| (row.found_by().unwrap_or_default(), value(row)));
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
            let name = quantity.replace('-', "_");
            let column = |table: &Table| table.columns.iter().position(|column| column.name == name);
            // Of several tables with the column, those first whose rows the references name.
            let known = reference::group(self.figure, quantity).unwrap_or_default();
            let is_named = |key: &&Option<String>| known.iter().any(|(name, _)| Some(*name) == key.as_deref());
            let named = |table: &&Table| table.keys.iter().filter(is_named).count();
            let keyed = |table: &&Table| table.keys.iter().any(Option::is_some) && column(table).is_some();
            let mut own: Vec<&Table> = tables.iter().filter(keyed).collect();
            own.sort_by_key(|table| std::cmp::Reverse(named(table)));
            let Some((table, i)) = own.first().and_then(|table| Some((table, column(table)?))) else {
                let what =
                    format!("the references `{quantity}` are compared with a column of that name, or by a claim");
                self.at_defaults()
                    .at_least(format!("{quantity}-references"), what, 0.0, 1.0);
                continue;
            };
            let limited = if table.at_full_trials {
                self.at_full_trials()
            } else {
                self.clone()
            };
            let statement = table.columns[i].meaning.trim_end_matches('.');
            let rows = own
                .iter()
                .filter_map(|table| Some(cells(table, column(table)?)))
                .flatten();
            limited.references(quantity, statement, rows, |cell| cell);
        }
    }
}

/// The key and the value of each row in a column.
fn cells(table: &Table, i: usize) -> impl Iterator<Item = (String, Option<Measured>)> {
    let rows = table.keys.iter().zip(&table.rows);
    rows.map(move |(key, row)| (key.clone().unwrap_or_default(), table.measured(row, i)))
}

/// The row of this name.
pub fn find<'r, R: Field>(rows: &'r [R], key: &str) -> Option<&'r R> {
    rows.iter().find(|row| row.found_by().as_deref() == Some(key))
}

/// The first number over the second, where both are there.
pub fn over(first: impl Mark, second: impl Mark) -> Option<f64> {
    Some(first.mark()?.0 / second.mark()?.0)
}

/// The first number minus the second, where both are there.
pub fn minus(first: impl Mark, second: impl Mark) -> Option<f64> {
    Some(first.mark()?.0 - second.mark()?.0)
}
