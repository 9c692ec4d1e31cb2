//! Receivers of the comparison: the mixed fusion centre under discrete dynamics, and what is no filter of likelihoods.

mod followers;
mod halves;
mod look_up;
mod mixed;
mod send_all;
#[cfg(test)]
mod tests;

pub(super) use followers::Followers;
pub(super) use halves::{Halves, bits, each, over_bits};
pub(super) use look_up::{LookUp, Patterns};
pub(super) use mixed::mixed;
pub(super) use send_all::SendAll;
