//! Bounds of `--bound` and other values per column: the language of `fewbits_recipes::bounds`, with this command's errors.

use crate::error::Error;
use fewbits_recipes::bounds;
use fewbits_record::Column;

pub(crate) use fewbits_recipes::bounds::{Spec, of_column, shown, summary};

/// The bound of columns that keep every bit.
pub(crate) const LOSSLESS: Spec = Spec {
    bound: fewbits_record::Bound::Lossless,
    period: None,
};

/// Values of an option per column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PerColumn<T>(bounds::PerColumn<T>);

impl From<fewbits_recipes::Error> for Error {
    fn from(source: fewbits_recipes::Error) -> Self {
        Self::Refused {
            what: "options",
            source: Box::new(source),
        }
    }
}

impl<T> PerColumn<T> {
    /// Parses the text. `others` is the value of columns that the text does not name.
    pub(crate) fn parse(text: &str, others: T, parse_one: impl Fn(&str) -> Result<T, Error>) -> Result<Self, Error> {
        bounds::PerColumn::parse(text, others, parse_one).map(Self)
    }

    /// The names with their values, and the value of all other columns.
    pub(crate) fn into_parts(self) -> (Vec<(String, T)>, T) {
        self.0.into_parts()
    }

    /// The value for a column.
    pub(crate) fn of(&self, name: &str) -> &T {
        self.0.of(name)
    }

    /// Checks that all names are columns of the table.
    pub(crate) fn check(&self, names: &[String], file: &str) -> Result<(), Error> {
        self.0.check(names).map_err(Error::recipe(file))
    }
}

/// Parses one bound, possibly on a circle.
pub(crate) fn parse_one(text: &str) -> Result<Spec, Error> {
    bounds::parse_one(text).map_err(refused)
}

fn refused(error: fewbits_recipes::Error) -> Error {
    Error::refused("--bound")(error)
}

/// The bound of each column, in their order. `file` appears in error messages.
pub(crate) fn parse(text: &str, names: &[String], file: &str) -> Result<Vec<Spec>, Error> {
    bounds::parse(text, names).map_err(|error| match error {
        error @ fewbits_recipes::Error::NoColumn { .. } => Error::recipe(file)(error),
        error => refused(error),
    })
}

/// Columns with their bounds. `ranges` are known if the file was read once before.
pub(crate) fn columns(
    names: &[String],
    specs: &[Spec],
    ranges: &[Option<(f64, f64)>],
    file: &str,
) -> Result<Vec<Column>, Error> {
    bounds::columns(names, specs, ranges).map_err(|error| match error {
        fewbits_recipes::Error::Column { column, source } => Error::Column {
            file: file.to_owned(),
            column,
            source,
        },
        error => Error::recipe(file)(error),
    })
}
