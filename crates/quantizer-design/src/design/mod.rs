//! Local design of breakpoints by Newton's method: of all groups or of some, also from several starts.

mod apart;
mod joint;

pub(crate) use joint::joint_until;
pub use joint::{Design, Scope, improved, joint, multi_start, of_groups, random_starts};
