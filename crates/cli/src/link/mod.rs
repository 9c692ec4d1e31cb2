//! Frames of links to rows.

pub(crate) mod format;
mod messages;
pub(crate) mod receive;
mod split;
mod tables;
