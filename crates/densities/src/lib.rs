//! Beliefs as values.
//!
//! A belief is what is known about the state at one moment. Here it is a plain value: it can be stored, sent, compared and
//! replayed, and the filters of the crates above are functions from one belief to the next.
//!
//! - [`Particles`]: weighted points, for a belief of any shape. Coordinates are columns and weights are logarithms; the price
//!   is that a single particle is scattered over `D + 1` slices, which suits filters (they sweep over all particles) and not
//!   programs that move one particle at a time.
//! - [`KernelEstimate`]: particles under a common Gaussian kernel ([`Bandwidth`] says how wide), so that they have a density.
//! - [`Mixture`]: a few Gaussians with full covariances: what a belief is reduced to ([`Reduction`]) before it travels.
//! - [`divergence`], [`plug_in`], [`quadrature`]: how far two beliefs are apart, estimated, bounded and integrated.
//! - [`product`]: several beliefs about one state, multiplied.
//! - [`wire`]: a mixture in a few bytes.
//! - [`Cells`]: equal small cells, refined until the moments have settled: the exact belief in few dimensions.
//! - [`Lpg`]: a linear combination of products of Hermite polynomials and Gaussians, squared, so that it is nowhere negative.
//! - [`Clumps`]: any cloud of weighted points summed up by a few hundred parts, to which [`Mixture`]s are fitted.
//! - [`laplace`]: Gaussians from the peak of a density and from its cumulants.
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

mod bandwidth;
mod beliefs;
pub mod cells;
pub mod clumps;
mod credible;
pub mod cut;
pub mod divergence;
mod error;
mod fast_kernel;
mod gaussian_cloud;
mod grid;
pub mod hermite;
mod kernel;
pub mod laplace;
pub mod lpg;
mod matrix;
pub mod merge;
mod mixture;
mod particles;
mod plane;
pub mod plug_in;
mod point_mass;
pub mod product;
pub mod quadrature;
mod reduce;
mod refine;
mod stored;
pub mod tree;
mod weights;
pub mod wire;

pub use bandwidth::{Bandwidth, Rule, SampleSize, Shape};
pub use cells::{CellOptions, CellTarget, Cells};
pub use clumps::{Clump, Clumps, MixtureFit};
pub use credible::{HighestDensity, ellipse};
pub use cut::{Criterion, Cut, NodeErrors};
pub use error::Error;
pub use fast_kernel::TabulatedEstimate;
pub use gaussian_cloud::GaussianCloud;
pub use grid::Grid;
pub use kernel::KernelEstimate;
pub use lpg::Lpg;
pub use merge::MergeCost;
pub use mixture::{Component, Mixture};
pub use particles::Particles;
pub use plane::PlaneMass;
pub use plug_in::{Cubature, PlugIn};
pub use point_mass::PointMass;
pub use reduce::{PaperReductions, Reduction};
pub use refine::refine;
pub use tree::{Split, Tree};
pub use {nalgebra, rand};
