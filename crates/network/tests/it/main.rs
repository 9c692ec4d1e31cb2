//! Tests of whole networks.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod acknowledgements;
mod attacks;
mod bit_star;
mod books;
mod contention;
mod defects;
mod duty;
mod faults;
mod lossless;
mod scale;
mod stored;
mod wild;
mod worlds;
