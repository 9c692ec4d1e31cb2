//! Designing the patterns: exact errors instead of simulation, so that a search cannot be fooled by noise.
//!
//! | question | answer |
//! |---|---|
//! | best set of linear patterns, small `B` and `N` | [`LinearSearch::best`], all sets |
//! | the same with the Gray basis fixed (strategy 1) | [`LinearSearch::with_forced`] |
//! | more sensors than can be searched (strategy 2) | [`tile`] |
//! | rank by equation 5.13 (strategy 3, poor) | [`by_information`] |
//! | large `B` or `N`, any patterns, unequal sensors | [`Descent`] |
//! | thresholds off the grid | [`free_thresholds`] |

mod descent;
mod exhaustive;
mod free;
mod lbfgs;
mod strategies;

pub use descent::{Descended, Descent};
pub use exhaustive::{LinearSearch, MaskSet};
pub use free::{FreeDesign, free_thresholds};
pub use strategies::{by_information, tile};

/// Nodes for searching: half the width of the final ones suffices with fewer points, to about `1e-10`.
pub(crate) const SEARCH_PANEL: f64 = 1.6;

/// A fixed sequence of scattered numbers in `[0, 1)` for starting points: designs use no random numbers.
pub(crate) fn scattered(index: usize) -> f64 {
    // The mixing function of SplitMix64: neighbouring indices must not make related starts.
    let mut z = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
