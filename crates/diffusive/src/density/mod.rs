//! Densities of the position and rate of a source: the exact posterior over cells, and approximations that are fitted to it.
//!
//! | density | use it when |
//! |---|---|
//! | [`Cells`] | moments must be exact (about 1e-7) in one to three dimensions; needs thousands of evaluations |
//! | [`Clumps`] | a mixture is to be fitted to cells: a few hundred weighted Gaussians with the moments of all cells |
//! | [`Lpg`] | the shape must be described by few numbers: the square of a series of Hermite polynomials about Gaussians |
//! | [`laplace`] | there is one peak: its mode and curvature |
//!
//! [`polynomials`] has the Hermite polynomials and the plain series of the paper.

mod cells;
mod clumps;
pub mod laplace;
mod mixture_fit;
mod series;

pub use cells::{CellOptions, CellTarget, Cells};
pub(crate) use cells::{lattice, split};
pub use clumps::{Clump, Clumps};
pub use mixture_fit::MixtureFit;
pub use series::{Lpg, LpgFit, Slice, SliceMoments, polynomials};
