//! Algorithms that choose the breakpoints.

mod alternating;
mod cells;
mod dynamic_programme;
mod index_assignment;
mod joint;
mod multi_interval;
mod separation;
mod symmetry;

pub use alternating::{Alternated, Alternating, alternate, alternating_step};
pub use dynamic_programme::{MAX_CANDIDATES, best_contiguous};
pub use index_assignment::{Assignment, assign_words, word_classes};
pub use joint::{Design, cyclic, greedy, joint, multi_start, optimise_groups, random_starts};
pub use multi_interval::{Discovery, discover};
pub use separation::{Separation, separate};
pub use symmetry::symmetry_breaking;
