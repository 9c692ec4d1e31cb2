//! Integration tests of `fewbits-protocol`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod centre;
mod frame;
mod handover;
mod sensor;
mod uplink;
mod wild;
