//! Search for good patterns. Errors are exact, so the ranking does not depend on random numbers.
//!
//! | task | function |
//! |---|---|
//! | best set of linear patterns, for small `B` and `N` | [`LinearSearch::best`], which tries all sets |
//! | large `B` or `N`, any patterns, unequal sensors | [`Descent`] |
//! | thresholds that are not edges of a grid | [`free_breakpoints`] |

mod descent;
mod exhaustive;
mod free;
mod outcomes;

pub use descent::{Descended, Descent};
pub use exhaustive::{LinearSearch, MaskSet};
pub use free::{FreeDesign, free_breakpoints};
