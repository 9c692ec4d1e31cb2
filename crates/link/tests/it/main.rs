//! Integration tests of `fewbits-link`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod attacks;
mod stops;
mod world;
mod worlds;
