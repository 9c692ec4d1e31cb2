//! Integration tests of `fewbits-link`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod attacks;
#[cfg(feature = "live")]
mod live;
mod stops;
mod world;
mod worlds;
