//! Tests of the models against independent references.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a panic is how a test fails"
)]

mod auto;
mod diffusion_entries;
mod diffusion_fixtures;
mod diffusion_laws;
mod diffusion_sources;
mod laws;
mod source_model;
mod wild;
