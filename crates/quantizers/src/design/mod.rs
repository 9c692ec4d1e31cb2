//! Algorithms that choose the breakpoints.

mod joint;

pub use joint::{Design, greedy, joint, multi_start, optimise_groups};
