//! Integration tests of the quantizer-design crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod c_header;
mod laws;
mod mi_fixtures;
mod models;
mod nelder_mead;
mod request;
mod scale;
mod wild;
