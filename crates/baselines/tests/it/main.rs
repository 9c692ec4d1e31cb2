//! Bounds against exact discrete chains and laws, wild arguments.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod chains;
#[path = "../../../densities/tests/it/common.rs"]
mod common;
mod divergences;
mod over_bits;
mod products;
mod quadrature;
