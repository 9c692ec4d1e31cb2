//! Integration tests of `fewbits-link`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod attacks;
mod followed;
#[cfg(feature = "live")]
mod live;
mod restarts;
mod stops;
mod transports;
mod world;
mod worlds;
