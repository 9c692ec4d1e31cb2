//! Densities by their values at the nodes of a grid, on a line and in the plane.

mod axis;
mod line;
mod plane;

pub use axis::UniformGrid;
pub use line::PointMass;
pub use plane::PlaneMass;
