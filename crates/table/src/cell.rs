//! Cells of text as cells of columns.

use crate::column::{Cells, Kind, MAX_WORDS};
use crate::hint::without_unit;
use crate::missing::{self, Spellings};
use crate::number::{self, Number};
use crate::profile::boolean;
use crate::words::Words;
use crate::written::{AMBIGUOUS, Clock};

/// What is known of the cells of a column.
pub(crate) struct Meaning<'a> {
    pub(crate) syntax: number::Syntax,
    pub(crate) gaps: &'a Spellings,
    pub(crate) strips: bool,
    pub(crate) clock: Option<&'a Clock>,
    pub(crate) kind: Kind,
    /// The unit behind the first number, if units are cut off.
    pub(crate) unit: Option<&'a str>,
}

impl Meaning<'_> {
    /// Whether numbers are shares of a hundred whose sign is cut off. Others may be shares of 1.
    fn has_per_cent(&self) -> bool {
        self.strips && self.unit == Some("%")
    }
}

/// Adds a cell to the cells of its column.
pub(crate) fn push_cell(
    cells: &mut Cells,
    text: &str,
    meaning: &Meaning<'_>,
    words: &mut Words,
) -> Result<(), number::Problem> {
    if matches!(cells, Cells::Words(_)) && text.contains('\0') {
        return Err(("has NUL bytes, as after a loss of power", "leave such lines out with --skip-bad"));
    }
    // A word that was there before is no gap.
    if let (Cells::Words(indices), true) = (&mut *cells, meaning.gaps.is_empty())
        && let Some(place) = words.place(text)
    {
        indices.push(Some(place));
        return Ok(());
    }
    let is_numeric = matches!(meaning.kind, Kind::Number | Kind::Integer | Kind::Boolean);
    let is_gap = missing::is_usual(text, is_numeric) || (!meaning.gaps.is_empty() && meaning.gaps.has_text(text));
    match cells {
        Cells::Numbers(numbers) => numbers.push(if is_gap { None } else { number(text, meaning)? }),
        Cells::Integers(integers) => integers.push(if is_gap { None } else { integer(text, meaning.syntax)? }),
        Cells::Booleans(booleans) => booleans.push(match (is_gap, boolean(text)) {
            (true, _) => None,
            (_, Some(yes)) => Some(yes),
            _ => {
                return Err((
                    "is not true or false",
                    "mend the cell, name it with --missing, or leave the column out with --without",
                ));
            }
        }),
        Cells::Times(times) => times.push(match (is_gap, meaning.clock) {
            (true, _) => None,
            (_, Some(clock)) => Some(clock.parse(text)?),
            _ => return Err(AMBIGUOUS),
        }),
        Cells::Words(indices) if is_gap => indices.push(None),
        Cells::Words(indices) => {
            let known = words.place(text);
            if known.is_none() && words.is_fixed {
                return Err((
                    "is none of the words of the column",
                    "mend the cell, or leave the row out with --skip-bad",
                ));
            }
            if known.is_none() && (words.as_slice().len() == MAX_WORDS || meaning.kind == Kind::Text) {
                return Err(("is text, and the column has more than 256 texts", "leave the column out with --without"));
            }
            indices.push(Some(known.unwrap_or_else(|| words.push(text))));
        }
    }
    Ok(())
}

fn number(text: &str, meaning: &Meaning<'_>) -> Result<Option<f64>, number::Problem> {
    let parsed = number::parse(text.as_bytes(), meaning.syntax);
    let parsed = match (&parsed, meaning.strips, without_unit(text)) {
        (Err(_), true, Some((number, unit))) => match number::parse(number.as_bytes(), meaning.syntax) {
            Ok(_) if meaning.unit.is_some_and(|known| known != unit) => Err((
                "has another unit than rows before",
                "write all cells in one unit, or leave such rows out with --skip-bad",
            )),
            found => found,
        },
        _ => parsed,
    };
    match parsed {
        Ok(Number::Double(value, _)) if value != 0.0 && meaning.has_per_cent() && without_unit(text).is_none() => {
            Err(("has no `%`, and others of the column have one", "write it, or leave such rows out with --skip-bad"))
        }
        Ok(Number::Double(value, _)) => Ok(Some(value).filter(|_| !meaning.gaps.has_number(value))),
        Ok(Number::Whole(_)) => Err((
            "is a whole number of more than 53 bits among numbers that are read as doubles",
            "take a file instead of a pipe if all are whole, split the column, or leave it out with --without",
        )),
        Err(problem) => Err(problem),
    }
}

/// Whole doubles below this are numbers of 64 bits.
const MOST: f64 = 9_223_372_036_854_775_808.0;

fn integer(text: &str, syntax: number::Syntax) -> Result<Option<i64>, number::Problem> {
    match number::parse(text.as_bytes(), syntax)? {
        Number::Whole(whole) => Ok(Some(whole)),
        Number::Double(value, _) if value.fract() == 0.0 && (-MOST..MOST).contains(&value) => Ok(Some(value as i64)),
        Number::Double(..) => Err((
            "is no whole number, as others of the column",
            "mend the cell, or leave the column out with --without",
        )),
    }
}
