//! The observation model: the source, the sensors with their noise, and their joint reports.

pub(crate) mod bank;
pub(crate) mod sensor;
pub(crate) mod source;
