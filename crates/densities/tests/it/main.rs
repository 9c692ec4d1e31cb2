//! Tests of the public interface.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beliefs;
mod bounds;
mod common;
mod fixtures;
mod grids;
mod laplace;
mod laws;
mod merging;
mod particles;
mod products;
mod quadrature;
mod reduction;
mod series;
mod wild;
mod wire;
