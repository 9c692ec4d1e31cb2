//! Closed forms of simple bodies, against which the grids are tested: a slab, two media, a cylinder, a ball.

mod bessel;
mod cylinder;
mod slab;
mod sphere;
mod two_media;

pub use cylinder::Cylinder;
pub use slab::{SlabWall, green as slab_green};
pub use sphere::Sphere;
pub use two_media::TwoMedia;
