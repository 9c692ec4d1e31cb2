//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

pub(crate) mod beyond;
mod case;
pub(crate) mod field;
mod linear;
pub(crate) mod no_feedback;
mod nonlinear;
mod pictures;
mod rates;
mod rows;
pub(crate) mod scalar;
mod setting;
pub(crate) mod vector;
mod world;
