//! One-bit quantizers at many sensors.

mod bank;
pub mod baselines;
pub mod bounds;
mod continuous_map;
pub mod count;
mod decoder;
mod grid;
mod linear;
mod pattern;
mod quantizer;
pub mod search;
mod source;

pub(crate) use bank::IMPOSSIBLE;
pub use bank::{Bank, MAX_OUTCOMES, Sensor};
pub use decoder::{Decoder, LookupTable, MAX_TABLE_SENSORS};
pub use grid::{Grid, MAX_BITS, MAX_EIGHT_LEVEL_EDGES};
pub use linear::{Mask, check_mask, generator_matrix, gray_basis, linear_pattern, mask_of, natural_basis, rank};
pub use pattern::{Pattern, check_separation};
pub use quantizer::BinaryQuantizer;
pub(crate) use source::Nodes;
pub use source::Source;
