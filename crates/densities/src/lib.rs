//! Beliefs as values.
//!
//! A belief is what is known about the state at one moment. Here it is a plain value: it can be stored, sent, compared and
//! replayed, and the filters of the crates above are functions from one belief to the next.
//!
//! - [`Particles`]: weighted points, for a belief of any shape. Coordinates are columns and weights are logarithms; the price
//!   is that a single particle is scattered over `D + 1` slices, which suits filters (they sweep over all particles) and not
//!   programs that move one particle at a time.
//! - [`GaussianCloud`]: weighted Gaussians that share one covariance, the belief of a Rao-Blackwellised filter.
//! - [`PointMass`] on a [`Grid`], [`PlaneMass`] on a lattice: densities of one and two dimensions by their values at nodes.
//!
//! ```
//! use fewbits_densities::Particles;
//! let belief = Particles::uniform([vec![1.0, 2.0, 3.0], vec![0.0, 1.0, 2.0]])?;
//! assert_eq!(belief.mean().as_slice(), &[2.0, 1.0]);
//! assert!((belief.covariance()[(0, 1)] - 2.0 / 3.0).abs() < 1e-15);
//! # Ok::<(), fewbits_densities::Error>(())
//! ```
//!
//! Not here: dynamics, measurements and resampling, which belong to filters.

mod error;
mod gaussian_cloud;
mod grid;
mod particles;
mod plane;
mod point_mass;
mod stored;

pub use error::Error;
pub use gaussian_cloud::GaussianCloud;
pub use grid::Grid;
pub use particles::Particles;
pub use plane::PlaneMass;
pub use point_mass::PointMass;
pub use {nalgebra, rand};
