//! Arguments of any type, refused with their names.
//!
//! PyO3 knows the name of an argument only after its conversion has failed, and adds it to the exception as a note. `ArgumentError` takes its
//! name from that note (`fewbits/errors.py`).

use crate::array::shown;
use crate::error::{Outcome, wrong};
use crate::record::Stated;
use pyo3::PyTypeInfo;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Longest value that a message shows, in characters.
const SHOWN: usize = 60;

/// What is expected of an argument of a type.
pub(crate) trait Expected {
    /// In a message.
    fn expected() -> String;
}

macro_rules! expected {
    ($($kind:ty => $text:expr,)*) => {$(
        impl Expected for $kind {
            fn expected() -> String {
                $text.to_owned()
            }
        }
    )*};
}

expected! {
    f64 => "a number",
    bool => "True or False",
    usize => "a whole number, 0 or above",
    u64 => "a whole number from 0 to 2^64 - 1",
    u32 => "a whole number from 0 to 2^32 - 1",
    u8 => "a whole number from 0 to 255",
    i32 => "a whole number of 32 bits",
    &str => "a text",
    String => "a text",
    PathBuf => "the path of a file",
    Stated => "a bound as '±0.1', a number, or a dictionary of such by column",
    (f64, f64) => "two numbers",
    ((f64, f64), (f64, f64)) => "two pairs of numbers",
}

impl<T: Expected> Expected for Option<T> {
    fn expected() -> String {
        format!("{}, or None", T::expected())
    }
}

impl<T: Expected> Expected for Vec<T> {
    fn expected() -> String {
        format!("a sequence, each entry {}", T::expected())
    }
}

impl<T: Expected> Expected for BTreeMap<String, T> {
    fn expected() -> String {
        format!("a dictionary of texts, each with {}", T::expected())
    }
}

/// A value in a message.
fn value(given: &Bound<'_, PyAny>) -> String {
    let is_plain = given.is_none()
        || given.is_instance_of::<PyString>()
        || given.is_instance_of::<PyFloat>()
        || given.is_instance_of::<PyInt>()
        || given.is_instance_of::<PyList>()
        || given.is_instance_of::<PyTuple>()
        || given.is_instance_of::<PyDict>();
    match given.repr() {
        Ok(text) if is_plain => {
            let text = text.to_string();
            match text.char_indices().nth(SHOWN) {
                Some((end, _)) => format!("{}...", &text[..end]),
                None => text,
            }
        }
        _ => shown(given),
    }
}

/// Converts an argument. What Python raises in a conversion of the caller's own is handed on.
pub(crate) fn named<'a, 'py, T: FromPyObject<'a, 'py> + Expected>(given: &'a Bound<'py, PyAny>) -> PyResult<T> {
    given.extract::<T>().map_err(|error| {
        let error: PyErr = error.into();
        let py = given.py();
        let range = error.is_instance_of::<PyOverflowError>(py);
        match range || error.is_instance_of::<PyTypeError>(py) || error.is_instance_of::<PyValueError>(py) {
            true => wrong("", value(given), T::expected(), !range),
            false => error,
        }
    })
}

/// A key of the dictionary that is the argument `name`.
pub(crate) fn key(name: &'static str, given: &Bound<'_, PyAny>) -> Outcome<String> {
    let text = given.extract::<String>();
    Ok(text.map_err(|_| {
        wrong(name, format!("a dictionary with the key {}", value(given)), "texts as keys".to_owned(), true)
    })?)
}

/// An argument of a class of this package.
pub(crate) fn of_class<'a, 'py, T: PyTypeInfo>(given: &'a Bound<'py, PyAny>) -> PyResult<&'a Bound<'py, T>> {
    let expected = || {
        format!(
            "a {}",
            T::type_object(given.py())
                .name()
                .map_or("class".into(), |name| name.to_string())
        )
    };
    given.cast::<T>().map_err(|_| wrong("", value(given), expected(), true))
}

/// As [`of_class`], or nothing.
pub(crate) fn of_class_or_none<'a, 'py, T: PyTypeInfo>(
    given: &'a Bound<'py, PyAny>,
) -> PyResult<Option<&'a Bound<'py, T>>> {
    if given.is_none() {
        Ok(None)
    } else {
        of_class(given).map(Some)
    }
}
