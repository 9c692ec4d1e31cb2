//! Functions of the page: tables, one bit, quantizer design. Errors are the library's own sentences.
#![forbid(unsafe_code)]

mod design;
mod one_bit;
mod table;

pub use design::design;
pub use one_bit::{Run, one_bit};
pub use table::Opened;
