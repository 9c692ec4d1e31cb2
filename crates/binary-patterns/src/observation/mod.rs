//! What is observed: the source, the sensors with their noise, and what they may report.

pub(crate) mod bank;
pub(crate) mod sensor;
pub(crate) mod source;
