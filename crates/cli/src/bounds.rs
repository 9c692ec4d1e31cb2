//! `--bound`: from text to columns with promises.

use crate::error::Error;
use fewbits_record::{Bound, Column};

const EXPECTED: &str = "`±0.1`, `1%`, `decimals:3` or `lossless`, on a circle with `@360` behind it";

/// What the text says of one column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spec {
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
}

const LOSSLESS: Spec = Spec {
    bound: Bound::Lossless,
    period: None,
};

fn refused(value: &str) -> Error {
    Error::Option {
        option: "--bound",
        value: value.to_owned(),
        expected: EXPECTED,
    }
}

fn parse_one(text: &str) -> Result<Spec, Error> {
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

/// The bound of each column, in their order. `file` is for messages.
pub(crate) fn parse(text: &str, names: &[String], file: &str) -> Result<Vec<Spec>, Error> {
    let (mut specs, mut others) = (vec![None; names.len()], LOSSLESS);
    for part in text.split(',').filter(|part| !part.trim().is_empty()) {
        // Names may contain `=`; bounds do not.
        let Some((name, bound)) = part.trim().rsplit_once('=') else {
            return Err(Error::Option {
                option: "--bound",
                value: part.to_owned(),
                expected: "`column=bound`, or `*=bound` for all others",
            });
        };
        let spec = parse_one(bound)?;
        if name == "*" {
            others = spec;
        } else if let Some(i) = names.iter().position(|known| known == name) {
            specs[i] = Some(spec);
        } else {
            return Err(Error::NoColumn {
                file: file.to_owned(),
                column: name.to_owned(),
                existing: names.join(", "),
            });
        }
    }
    Ok(specs.into_iter().map(|spec| spec.unwrap_or(others)).collect())
}

/// Columns with their promises; `ranges` are known for files that were read once before.
pub(crate) fn columns(
    names: &[String],
    specs: &[Spec],
    ranges: &[Option<(f64, f64)>],
    file: &str,
) -> Result<Vec<Column>, Error> {
    let column = |((name, spec), range): ((&String, &Spec), &Option<(f64, f64)>)| {
        let mut column = Column::new(name, spec.bound)?;
        if let Some(period) = spec.period {
            column = column.with_period(period)?;
        }
        match range {
            Some((from, to)) => column.with_range(*from, *to),
            None => Ok(column),
        }
    };
    let columns = names.iter().zip(specs).zip(ranges).map(column);
    columns.collect::<Result<_, _>>().map_err(Error::recording(file))
}

/// A bound as `--bound` takes it.
pub(crate) fn shown(bound: Bound, period: Option<f64>) -> String {
    let bound = match bound {
        Bound::Lossless => "lossless".to_owned(),
        Bound::Absolute(delta) => format!("±{delta}"),
        Bound::ShareOfRange(share) => format!("{}%", (1e12 * share).round() / 1e10),
        Bound::Decimals(places) => format!("decimals:{places}"),
        _ => "?".to_owned(),
    };
    period.map_or(bound.clone(), |period| format!("{bound}@{period}"))
}
