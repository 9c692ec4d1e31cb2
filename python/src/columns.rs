//! Columns of tables as plain bytes, so that tables can be pickled.

use crate::error::{Outcome, refused};
use crate::table::joined;
use arrow_array::{Array, ArrayRef};
use arrow_data::ArrayData;
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, DataType};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Name, type in the words of Arrow's C interface, rows, the bits of what is not null, and buffers.
pub(crate) type Plain<'py> = (String, String, usize, Option<Bound<'py, PyBytes>>, Vec<Bound<'py, PyBytes>>);
/// The same, given.
pub(crate) type Given = (String, String, usize, Option<Vec<u8>>, Vec<Vec<u8>>);

/// A column as bytes.
pub(crate) fn plain<'py>(py: Python<'py>, name: &str, column: &dyn Array) -> Outcome<Plain<'py>> {
    let kind = column.data_type();
    if kind.is_nested() || matches!(kind, DataType::Dictionary(..) | DataType::Utf8View | DataType::BinaryView) {
        return refused(
            "column",
            format!("'{name}' of {kind}"),
            "a column of numbers, texts or times in a table that is stored",
        );
    }
    // A copy without an offset, whose buffers hold its rows only.
    let data = joined(kind, &[column])?.to_data();
    let nulls = data.nulls().map(|nulls| {
        let bits: Vec<u8> = nulls
            .iter()
            .collect::<Vec<bool>>()
            .chunks(8)
            .map(|bits| {
                bits.iter()
                    .enumerate()
                    .fold(0, |byte, (i, bit)| byte | u8::from(*bit) << i)
            })
            .collect();
        PyBytes::new(py, &bits)
    });
    let buffers = data.buffers().iter().map(|buffer| PyBytes::new(py, buffer.as_slice()));
    let schema = FFI_ArrowSchema::try_from(kind)?;
    Ok((name.to_owned(), schema.format().to_owned(), data.len(), nulls, buffers.collect()))
}

/// The column of [`plain`]. All of it is checked, as what comes from another program is.
pub(crate) fn column((name, format, rows, nulls, buffers): Given) -> Outcome<(String, ArrayRef)> {
    let made = || -> Result<ArrayRef, ArrowError> {
        // Such a type has others within, which are not given.
        if format.starts_with('+') {
            return Err(ArrowError::InvalidArgumentError(format!("no type `{format}`")));
        }
        let kind = DataType::try_from(&FFI_ArrowSchema::try_new(&format, Vec::new(), None)?)?;
        let mut data = ArrayData::builder(kind).len(rows).align_buffers(true);
        if let Some(nulls) = nulls {
            data = data.null_bit_buffer(Some(nulls.into()));
        }
        for buffer in buffers {
            data = data.add_buffer(buffer.into());
        }
        Ok(arrow_array::make_array(data.build()?))
    };
    match made() {
        Ok(column) => Ok((name, column)),
        Err(error) => refused("column", format!("'{name}'"), format!("a stored one: {error}")),
    }
}
