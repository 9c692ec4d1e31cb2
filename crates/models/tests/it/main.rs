//! Tests of the models against independent references.

mod diffusion_fixtures;
mod diffusion_laws;
mod finite_volume;
mod laws;
