//! Algorithms that choose the breakpoints.

mod alternating;
mod apart;
mod cells;
mod cyclic;
mod dynamic_programme;
mod front;
mod index_assignment;
mod joint;
mod multi_interval;
mod separation;
mod symmetry;

pub use alternating::{AllowedCells, Alternated, Alternating, alternate, alternating_step};
pub use cyclic::cyclic;
pub use dynamic_programme::{MAX_CANDIDATES, best_contiguous};
pub use front::{Report, detection, estimation};
pub use index_assignment::{Words, WordsDesign, assign_words, word_classes};
pub use joint::{Design, Scope, greedy, joint, multi_start, optimise_groups, random_starts};
pub use multi_interval::{Discovery, discover};
pub use separation::{Separation, bhattacharyya_coefficient, separate};
pub use symmetry::symmetry_breaking;
