//! Small dense matrices and tridiagonal systems.

pub mod eigen;
pub mod factored;
pub mod linalg;
mod tolerances;
pub mod tridiagonal;
