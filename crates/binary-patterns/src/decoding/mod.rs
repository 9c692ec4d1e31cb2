//! From the reports to an estimate.

pub(crate) mod continuous_map;
pub(crate) mod decoder;
pub(crate) mod table;
