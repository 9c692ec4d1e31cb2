//! Several targets: association of few-bit reports, against the same with full values.

pub(crate) mod gospa;
mod world;
