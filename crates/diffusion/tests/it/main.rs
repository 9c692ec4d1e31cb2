//! Finite volumes against independent references, closed forms and conservation laws.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod bessel;
mod bodies;
mod cases;
mod closed;
mod cylinder;
mod field;
mod fixtures;
mod gaden;
mod laws;
mod leak;
mod refusals;
mod round;
mod slab;
mod sphere;
mod two_media;
mod wild;
