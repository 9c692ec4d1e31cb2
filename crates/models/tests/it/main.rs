//! Tests of the models against independent references.

mod diffusion_fixtures;
mod diffusion_laws;
#[cfg(feature = "finite-volume")]
mod finite_volume;
