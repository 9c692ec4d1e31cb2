//! States as bytes, so that objects can be pickled and copied.

use crate::error::{Outcome, refused};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The first byte of a state.
const VERSION: u8 = 1;

/// What makes an object again: a function of its class, and the function's arguments.
pub(crate) type Reduced<'py, T> = (Bound<'py, PyAny>, T);

/// The bytes of a state.
pub(crate) fn bytes<'py>(py: Python<'py>, state: &impl Serialize) -> Outcome<Bound<'py, PyBytes>> {
    let mut bytes = vec![VERSION];
    match ciborium::into_writer(state, &mut bytes) {
        Ok(()) => Ok(PyBytes::new(py, &bytes)),
        Err(error) => refused("state", error, "a state that can be stored"),
    }
}

/// The state of these bytes.
pub(crate) fn state<T: DeserializeOwned>(given: &Bound<'_, PyAny>) -> Outcome<T> {
    let bytes = crate::array::bytes("state", given)?;
    let expected = format!("a state of version {VERSION}");
    let Some((&VERSION, mut rest)) = bytes.split_first() else {
        return refused("state", format!("{} bytes", bytes.len()), expected);
    };
    read("state", &mut rest, &expected)
}

/// A value from CBOR without anything behind it, refused as the argument `name`.
pub(crate) fn read<T: DeserializeOwned>(name: &'static str, rest: &mut &[u8], expected: &str) -> Outcome<T> {
    // By way of the format's own tree: the code of each type is then half as large.
    match ciborium::from_reader::<ciborium::Value, _>(&mut *rest) {
        Ok(tree) if rest.is_empty() => match tree.deserialized() {
            Ok(value) => Ok(value),
            Err(error) => refused(name, error, expected),
        },
        Ok(_) => refused(name, format!("{} bytes too many", rest.len()), expected),
        Err(error) => refused(name, error, expected),
    }
}

/// The function of a class that takes a state.
pub(crate) fn maker<'py, T: pyo3::PyTypeInfo>(py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
    py.get_type::<T>().getattr("_restored")
}
