//! Several targets: association of few-bit reports, against the same with full values.

pub mod gospa;
mod world;
