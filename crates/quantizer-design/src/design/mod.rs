//! Local design of all breakpoints by Newton's method, one sensor after the other or from several starts.

mod apart;
mod joint;

pub(crate) use joint::joint_until;
pub use joint::{Design, Scope, greedy, improved, joint, multi_start, random_starts};
