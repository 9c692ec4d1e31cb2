//! Integration tests: fixtures of another program, laws, bad input.

#![allow(clippy::unwrap_used, clippy::panic)]

mod allocation;
mod attacks;
#[path = "../../../densities/tests/it/common.rs"]
mod common;
mod fixtures;
mod grid;
mod laws;
mod products;
mod recording;
mod wild;
