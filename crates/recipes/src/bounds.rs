//! The language of bounds: `temp=±0.1,flow=1%,wind=±2@360,*=decimals:3`.
//!
//! ```text
//! bounds := [bound ,] named , ...        a bound without a name applies to all other columns and stands first
//! named  := column=bound | *=bound       `*`: all other columns; a name with a comma or `=` stands in double quotes
//! bound  := size [@circumference]
//! size   := ±number | number% | rel:number%±number | decimals:digits | lossless
//! ```
//!
//! Numbers have a point. A comma ends a part, so that `±2,5` has two bounds without a name and is refused.

use crate::error::Error;
use crate::names::{self, Part};
use fewbits_record::{Bound, Column};

/// The forms of a bound, for messages.
pub const EXPECTED: &str = "`±0.1`, `1%`, `rel:1%±0.001`, `decimals:3` or `lossless`, on a circle with `@360` behind it; for one column as `column=bound`";

/// The bound of one column as the text states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// The bound.
    pub bound: Bound,
    /// Circumference of the circle, if samples are directions.
    pub period: Option<f64>,
}

impl Spec {
    /// The bound of columns that the text does not name.
    pub const LOSSLESS: Self = Self {
        bound: Bound::Lossless,
        period: None,
    };
}

/// Values of an option per column: `column=value,...`, with `*=value` or a first `value` for all others.
#[derive(Debug, Clone, PartialEq)]
pub struct PerColumn<T> {
    named: Vec<(String, T)>,
    others: T,
}

impl<T> PerColumn<T> {
    /// Parses the text. `others` is the value of columns that the text does not name.
    ///
    /// # Errors
    /// If a value is refused by `parse_one`, a value without a name stands behind another one (as with a decimal comma), or a column has
    /// two values.
    pub fn parse<E: From<Error>>(text: &str, others: T, parse_one: impl Fn(&str) -> Result<T, E>) -> Result<Self, E> {
        // All parts are checked before a value is parsed: with a decimal comma the values are right, but not what was meant.
        let (mut before, mut values) = (None::<String>, Vec::<(Option<String>, String)>::new());
        for Part { quoted, rest } in names::parts(text)? {
            let (name, value) = match &quoted {
                // A quoted name is followed by its value.
                Some(name) => (Some(name.as_str()), rest.strip_prefix('=')),
                // Names may contain `=`; values do not.
                None => rest
                    .rsplit_once('=')
                    .map_or((None, Some(&*rest)), |(name, value)| (Some(name.trim()), Some(value))),
            };
            let Some(value) = value.map(str::trim) else {
                return Err(Error::Quote { text: text.to_owned() }.into());
            };
            if let (None, Some(before)) = (name, &before) {
                let decimal = is_decimal_comma(before, value).then(|| format!("{before}.{value}"));
                let (text, part) = (text.to_owned(), value.to_owned());
                return Err(Error::Stray { text, part, decimal }.into());
            }
            // `None` stands for all other columns.
            let name = name.filter(|name| quoted.is_some() || *name != "*").map(str::to_owned);
            if values.iter().any(|(known, _)| *known == name) {
                let (text, name) = (text.to_owned(), name.unwrap_or_else(|| "*".to_owned()));
                return Err(Error::Twice { text, name }.into());
            }
            values.push((name, value.to_owned()));
            before = Some(rest);
        }
        let mut found = Self {
            named: Vec::new(),
            others,
        };
        for (name, value) in values {
            match name {
                Some(name) => found.named.push((name, parse_one(&value)?)),
                None => found.others = parse_one(&value)?,
            }
        }
        Ok(found)
    }

    /// The columns that the text names with their values, and the value of all others.
    pub fn into_parts(self) -> (Vec<(String, T)>, T) {
        (self.named, self.others)
    }

    /// The value for a column.
    pub fn of(&self, name: &str) -> &T {
        let named = self.named.iter().find(|(known, _)| known == name);
        named.map_or(&self.others, |(_, value)| value)
    }

    /// Checks that all names are columns of the table.
    ///
    /// # Errors
    /// If one is not.
    pub fn check<S: AsRef<str>>(&self, names: &[S]) -> Result<(), Error> {
        let mut named = self.named.iter();
        named.try_for_each(|(name, _)| names::position(names, name).map(drop))
    }
}

/// Whether two parts are one number with a decimal comma.
fn is_decimal_comma(before: &str, part: &str) -> bool {
    before.ends_with(|end: char| end.is_ascii_digit()) && part.starts_with(|first: char| first.is_ascii_digit())
}

fn refused(value: &str) -> Error {
    Error::Bound {
        bound: value.to_owned(),
        expected: EXPECTED,
    }
}

/// Parses one bound, possibly on a circle.
///
/// # Errors
/// If it is none of the forms of [`EXPECTED`].
pub fn parse_one(text: &str) -> Result<Spec, Error> {
    let (bound, period) = match text.split_once('@') {
        None => (text, None),
        Some((bound, period)) => (bound, Some(period.trim().parse::<f64>().map_err(|_| refused(text))?)),
    };
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| refused(bound));
    let bound = if bound == "lossless" {
        Bound::Lossless
    } else if let Some(places) = bound.strip_prefix("decimals:") {
        Bound::Decimals(places.trim().parse().map_err(|_| refused(bound))?)
    } else if let Some(relative) = bound.strip_prefix("rel:") {
        // Of each value, with a floor: there is no relative bound of zero.
        let parts = relative.split_once('%').ok_or_else(|| refused(bound))?;
        let floor = parts.1.trim().strip_prefix('±').or(parts.1.trim().strip_prefix("+-"));
        Bound::Relative {
            share: 0.01 * number(parts.0)?,
            floor: number(floor.ok_or_else(|| refused(bound))?)?,
        }
    } else if let Some(percent) = bound.strip_suffix('%') {
        let percent = percent
            .strip_prefix('±')
            .or(percent.strip_prefix("+-"))
            .unwrap_or(percent);
        Bound::ShareOfRange(0.01 * number(percent)?)
    } else {
        let size = bound.strip_prefix('±').or(bound.strip_prefix("+-")).unwrap_or(bound);
        Bound::Absolute(number(size)?)
    };
    Ok(Spec { bound, period })
}

/// The bound of each column, in their order.
///
/// # Errors
/// If the text is not in the language, or names a column that does not exist.
pub fn parse<S: AsRef<str>>(text: &str, names: &[S]) -> Result<Vec<Spec>, Error> {
    let specs = PerColumn::parse(text, Spec::LOSSLESS, parse_one)?;
    specs.check(names)?;
    Ok(names.iter().map(|name| *specs.of(name.as_ref())).collect())
}

/// Columns with their bounds. `ranges`: smallest and largest value per column where they are known; only a share of a range needs them.
///
/// # Errors
/// If a bound is out of range, with the column's name.
pub fn columns<S: AsRef<str>>(
    names: &[S],
    specs: &[Spec],
    ranges: &[Option<(f64, f64)>],
) -> Result<Vec<Column>, Error> {
    let column = |name: &str, spec: &Spec, range: &Option<(f64, f64)>| {
        let mut column = Column::new(name, spec.bound)?;
        if let Some(period) = spec.period {
            column = column.with_period(period)?;
        }
        match (spec.bound, range) {
            (Bound::ShareOfRange(_), Some((from, to))) => column.with_range(*from, *to),
            _ => Ok(column),
        }
    };
    let columns = names.iter().zip(specs).zip(ranges).map(|((name, spec), range)| {
        column(name.as_ref(), spec, range).map_err(|source| Error::Column {
            column: name.as_ref().to_owned(),
            source,
        })
    });
    columns.collect()
}

/// A share in percent, without the digits that rounding adds.
fn percent(share: f64) -> f64 {
    (1e12 * share).round() / 1e10
}

/// The bound of a column in the language of this module. If its samples were restored from a recording, that bound stands behind it:
/// `±0.5 (and ±0.1 of an earlier recording: ±0.6)`.
pub fn of_column(column: &Column) -> String {
    let own = shown(column.bound(), column.period());
    let earlier = column.earlier_bound();
    match column.bound() {
        _ if earlier == 0.0 => own,
        Bound::Lossless => format!("±{} (of an earlier recording)", exact(earlier)),
        Bound::Absolute(delta) => {
            format!("{own} (and ±{} of an earlier recording: ±{})", exact(earlier), exact(rounded(delta + earlier)))
        }
        _ => format!("{own} (and ±{} of an earlier recording)", exact(earlier)),
    }
}

/// A sum of numbers of few digits, without the digits that rounding adds.
fn rounded(sum: f64) -> f64 {
    format!("{sum:.14e}").parse().unwrap_or(sum)
}

/// A bound in the language of this module.
pub fn shown(bound: Bound, period: Option<f64>) -> String {
    let bound = match bound {
        Bound::Lossless => "lossless".to_owned(),
        Bound::Absolute(delta) => format!("±{}", exact(delta)),
        Bound::ShareOfRange(share) => format!("{}%", percent(share)),
        Bound::Relative { share, floor } => format!("rel:{}%±{}", percent(share), exact(floor)),
        Bound::Decimals(places) => format!("decimals:{places}"),
        _ => "?".to_owned(),
    };
    period.map_or(bound.clone(), |period| format!("{bound}@{period}"))
}

/// The bounds of all columns in the language of this module: one alone if all are equal, otherwise each with its name.
pub fn summary(columns: &[Column]) -> String {
    let of = of_column;
    match columns.split_first() {
        Some((first, rest)) if rest.iter().all(|column| of(column) == of(first)) => format!("all {}", of(first)),
        _ => {
            let named = |column: &Column| format!("{}={}", names::shown(&[column.name()]), of(column));
            columns.iter().map(named).collect::<Vec<_>>().join(",")
        }
    }
}

/// A number with all its digits, with an exponent instead of many zeros.
pub fn exact(number: f64) -> String {
    if number == 0.0 || (1e-7..1e16).contains(&number.abs()) {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const NAMES: [&str; 3] = ["temp", "wind", "Temp, °F"];

    fn bounds(text: &str) -> Result<Vec<String>, Error> {
        Ok(parse(text, &NAMES)?
            .iter()
            .map(|spec| shown(spec.bound, spec.period))
            .collect())
    }

    #[test]
    fn forms_of_bounds() {
        for (text, expected) in [
            ("", ["lossless", "lossless", "lossless"]),
            ("±0.5", ["±0.5", "±0.5", "±0.5"]),
            ("1%,temp=±0.1", ["±0.1", "1%", "1%"]),
            ("temp = +-2@360, *=decimals:3", ["±2@360", "decimals:3", "decimals:3"]),
            ("rel:1%±0.001,temp=rel: 0.5 % +-2", ["rel:0.5%±2", "rel:1%±0.001", "rel:1%±0.001"]),
            ("\"Temp, °F\"=±0.1,wind=lossless,*=2e-9", ["±2e-9", "lossless", "±0.1"]),
        ] {
            assert_eq!(bounds(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn comma_in_a_bound_is_refused_with_the_point() {
        for (text, mend) in [
            ("temp=±2,5", "temp=±2.5"),
            ("±0,1", "±0.1"),
            ("*=±0,1", "*=±0.1"),
            ("temp=0,5%,wind=±1", "temp=0.5%"),
            ("temp=±1,wind=±2,5,*=lossless", "wind=±2.5"),
            ("\"Temp, °F\"=±0,1", ".1`"),
            ("temp=±2@360,5", "temp=±2@360.5"),
        ] {
            let message = bounds(text).unwrap_err().to_string();
            assert!(message.contains(mend) && message.contains("all other columns"), "{text}: {message}");
        }
    }

    #[test]
    fn stray_and_second_bounds_are_refused() {
        for text in ["temp=±1,±2", "±1,±2", "*=±1,±2", "temp=±1,lossless"] {
            assert!(matches!(bounds(text), Err(Error::Stray { decimal: None, .. })), "{text}");
        }
        for text in ["temp=±1,temp=±2", "*=±1,*=±2", "±1,*=±2"] {
            assert!(matches!(bounds(text), Err(Error::Twice { .. })), "{text}");
        }
        for text in [
            "temp=warm",
            "temp=",
            "temp=±0;5",
            "decimals:x",
            "±1@",
            "%",
            "rel:1%",
            "rel:±1",
            "rel:1%2",
        ] {
            assert!(matches!(bounds(text), Err(Error::Bound { .. })), "{text}");
        }
        assert!(matches!(bounds("\"Temp, °F\""), Err(Error::Quote { .. })));
        let message = bounds("x=±1").unwrap_err().to_string();
        assert_eq!(message, "no column `x`: there are temp, wind, \"Temp, °F\"; names with commas stand in quotes");
    }

    #[test]
    fn summary_has_every_column() {
        let columns = |text| columns(&NAMES, &parse(text, &NAMES).unwrap(), &[None; 3]).unwrap();
        assert_eq!(summary(&columns("±0.1")), "all ±0.1");
        assert_eq!(summary(&columns("1%,temp=±2@360")), "temp=±2@360,wind=1%,\"Temp, °F\"=1%");
    }

    #[test]
    fn summary_can_be_parsed_again() {
        let text = "temp=±2@360,wind=1%,\"Temp, °F\"=decimals:2";
        let parsed = columns(&NAMES, &parse(text, &NAMES).unwrap(), &[None; 3]).unwrap();
        assert_eq!(summary(&parsed), text);
    }
}
