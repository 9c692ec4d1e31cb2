//! Densities by their values at the nodes of a grid.

mod axis;
mod line;

pub use axis::UniformGrid;
pub use line::PointMass;
