//! Estimates from the reports of all sensors.

pub(crate) mod continuous_map;
pub(crate) mod decoder;
pub(crate) mod table;
