//! Integration tests of the Dymbo filters.

#![allow(clippy::unwrap_used, clippy::panic)]

mod centre;
mod fixtures;
mod laws;
mod limits;
mod wild;
