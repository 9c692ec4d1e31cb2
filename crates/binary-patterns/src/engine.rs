//! Parts of the exact enumeration, for the comparisons in `fewbits-baselines`. No promise is made of them.

pub use crate::decoding::sums::{moments, squared_error};
pub use crate::observation::source::Kind;
pub use crate::patterns::grid::{bits_in_range, support};
pub use crate::patterns::linear::{grid_bits, sensors_of};
