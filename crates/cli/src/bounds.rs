//! Parsing of `--bound`: from text to columns with error bounds.

use crate::error::Error;
use crate::numbers::exact;
use fewbits_record::{Bound, Column};

const EXPECTED: &str =
    "`±0.1`, `1%`, `decimals:3` or `lossless`, on a circle with `@360` behind it; for one column as `column=bound`";

/// The bound of one column as the text states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spec {
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
}

/// Values of an option per column: `column=value,...`, with `*=value` or only `value` for all others.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PerColumn<T> {
    named: Vec<(String, T)>,
    others: T,
}

impl<T> PerColumn<T> {
    /// Parses the text. `others` is the value of columns that the text does not name.
    pub(crate) fn parse(text: &str, others: T, parse_one: impl Fn(&str) -> Result<T, Error>) -> Result<Self, Error> {
        let mut found = Self {
            named: Vec::new(),
            others,
        };
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            // Names may contain `=`; values do not.
            match part.rsplit_once('=') {
                None | Some(("*", _)) => found.others = parse_one(part.trim_start_matches("*="))?,
                Some((name, value)) => found.named.push((name.to_owned(), parse_one(value)?)),
            }
        }
        Ok(found)
    }

    /// The value for a column.
    pub(crate) fn of(&self, name: &str) -> &T {
        let named = self.named.iter().find(|(known, _)| known == name);
        named.map_or(&self.others, |(_, value)| value)
    }

    /// Checks that all names are columns of the table.
    pub(crate) fn check(&self, names: &[String], file: &str) -> Result<(), Error> {
        match self.named.iter().find(|(name, _)| !names.contains(name)) {
            None => Ok(()),
            Some((name, _)) => Err(Error::no_column(file, name, names)),
        }
    }
}

const LOSSLESS: Spec = Spec {
    bound: Bound::Lossless,
    period: None,
};

fn refused(value: &str) -> Error {
    Error::option("--bound", value, EXPECTED)
}

/// Parses one bound, possibly on a circle.
pub(crate) fn parse_one(text: &str) -> Result<Spec, Error> {
    let (bound, period) = match text.split_once('@') {
        None => (text, None),
        Some((bound, period)) => (bound, Some(period.parse::<f64>().map_err(|_| refused(text))?)),
    };
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| refused(bound));
    let bound = if bound == "lossless" {
        Bound::Lossless
    } else if let Some(places) = bound.strip_prefix("decimals:") {
        Bound::Decimals(places.parse().map_err(|_| refused(bound))?)
    } else if let Some(percent) = bound.strip_suffix('%') {
        Bound::ShareOfRange(0.01 * number(percent)?)
    } else {
        let size = bound.strip_prefix('±').or(bound.strip_prefix("+-")).unwrap_or(bound);
        Bound::Absolute(number(size)?)
    };
    Ok(Spec { bound, period })
}

/// The bound of each column, in their order. `file` appears in error messages.
pub(crate) fn parse(text: &str, names: &[String], file: &str) -> Result<Vec<Spec>, Error> {
    let specs = PerColumn::parse(text, LOSSLESS, parse_one)?;
    specs.check(names, file)?;
    Ok(names.iter().map(|name| *specs.of(name)).collect())
}

/// Columns with their bounds. `ranges` are known if the file was read once before.
pub(crate) fn columns(
    names: &[String],
    specs: &[Spec],
    ranges: &[Option<(f64, f64)>],
    file: &str,
) -> Result<Vec<Column>, Error> {
    let column = |name: &String, spec: &Spec, range: &Option<(f64, f64)>| {
        let mut column = Column::new(name, spec.bound)?;
        if let Some(period) = spec.period {
            column = column.with_period(period)?;
        }
        match range {
            Some((from, to)) => column.with_range(*from, *to),
            None => Ok(column),
        }
    };
    let columns = names.iter().zip(specs).zip(ranges).map(|((name, spec), range)| {
        column(name, spec, range).map_err(|source| Error::Column {
            file: file.to_owned(),
            column: name.clone(),
            source,
        })
    });
    columns.collect()
}

/// A bound in the syntax of `--bound`.
pub(crate) fn shown(bound: Bound, period: Option<f64>) -> String {
    let bound = match bound {
        Bound::Lossless => "lossless".to_owned(),
        Bound::Absolute(delta) => format!("±{}", exact(delta)),
        Bound::ShareOfRange(share) => format!("{}%", (1e12 * share).round() / 1e10),
        Bound::Decimals(places) => format!("decimals:{places}"),
        _ => "?".to_owned(),
    };
    period.map_or(bound.clone(), |period| format!("{bound}@{period}"))
}
