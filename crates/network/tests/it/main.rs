//! Tests of whole networks.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod attacks;
mod books;
mod faults;
mod lossless;
mod stored;
mod worlds;
