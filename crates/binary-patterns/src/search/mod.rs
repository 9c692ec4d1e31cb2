//! Designing the patterns: exact errors instead of simulation, so that a search cannot be fooled by noise.
//!
//! | question | answer |
//! |---|---|
//! | best set of linear patterns, small `B` and `N` | [`LinearSearch::best`], all sets |
//! | the same with the Gray basis fixed (strategy 1) | [`LinearSearch::with_forced`] |
//! | more sensors than can be searched (strategy 2) | [`tile`](crate::published::tile) |
//! | rank by equation 5.13 (strategy 3, poor) | [`by_information`](crate::published::by_information) |
//! | large `B` or `N`, any patterns, unequal sensors | [`Descent`] |
//! | thresholds off the grid | [`free_breakpoints`] |

mod descent;
mod exhaustive;
mod free;
mod lbfgs;
mod outcomes;

pub use descent::{Descended, Descent};
pub use exhaustive::{LinearSearch, MaskSet};
pub use free::{FreeDesign, free_breakpoints, free_breakpoints_of_masks};
