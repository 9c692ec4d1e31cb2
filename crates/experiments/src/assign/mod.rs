//! Bit-to-sensor assignment: figures and tables.

pub(crate) mod networks;
pub(crate) mod shapes;
pub(crate) mod table6_1;
