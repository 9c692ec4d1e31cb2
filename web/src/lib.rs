//! Functions of the page: tables, one bit, quantizer design. Errors are the library's own sentences.
#![forbid(unsafe_code)]

mod clock;
mod design;
mod known;
mod one_bit;
mod reading;
mod recording;
mod table;
mod writing;

pub use design::design;
pub use one_bit::{Run, one_bit};
pub use table::{Effort, Opened};

use std::io::Read;
use wasm_bindgen::prelude::wasm_bindgen;

/// Unpacks gzip, for columns of Parquet files.
#[wasm_bindgen]
pub fn gunzip(packed: &[u8]) -> Result<Vec<u8>, String> {
    let mut all = Vec::new();
    match flate2::read::MultiGzDecoder::new(packed).read_to_end(&mut all) {
        Ok(_) => Ok(all),
        Err(error) => Err(text(error)),
    }
}

/// An error with its causes, as a sentence.
fn text(error: impl std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}
