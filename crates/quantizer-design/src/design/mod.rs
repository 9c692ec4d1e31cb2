//! Local design of breakpoints by Newton's method: of all groups or of some.

mod apart;
mod joint;

pub(crate) use joint::joint_until;
pub use joint::{Design, Scope, improved, joint, of_groups};
