//! Densities by their values at the nodes of a grid.

mod axis;
mod lattice;
mod line;

pub(crate) use axis::MAX_WIDTH;
pub use axis::UniformGrid;
pub use lattice::Lattice;
pub use line::PointMass;
