//! Integration tests of `fewbits-link`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod attacks;
mod c_envelope;
mod floods;
mod followed;
mod hellos;
mod live;
mod pairs;
mod prometheus;
mod restarts;
mod stops;
mod traces;
mod transports;
mod unchanged;
mod world;
mod worlds;
