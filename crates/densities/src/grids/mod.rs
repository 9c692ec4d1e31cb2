//! Densities by their values at the nodes of a grid.

mod axis;
mod lattice;
mod line;

pub use axis::UniformGrid;
pub use lattice::Lattice;
pub use line::PointMass;
