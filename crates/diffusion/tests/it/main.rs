//! Finite volumes against independent references, closed forms and conservation laws.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod bodies;
mod cases;
mod closed;
mod closed_forms;
mod field;
mod fixtures;
mod laws;
mod refusals;
