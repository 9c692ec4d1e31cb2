//! Core of fewbits.
pub mod error;
pub mod normal;
pub mod quadrature;
pub use error::ArgumentError;
pub use nalgebra;
