//! Densities of the position and rate of a source: the exact posterior over cells, and approximations that are fitted to it.
//!
//! | density | use it when |
//! |---|---|
//! | [`Cells`] | moments must be exact (about 1e-7) in one to three dimensions; needs thousands of evaluations |
//!
//! Mixtures are fitted to cells through [`Clumps`](fewbits_mixture_codec::Clumps).

mod cells;

pub use cells::{CellOptions, CellTarget, Cells};
pub(crate) use cells::{lattice, split};
