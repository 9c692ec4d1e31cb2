//! Estimates from the reports of all sensors.

pub(crate) mod decoder;
pub(crate) mod sums;
pub(crate) mod table;
