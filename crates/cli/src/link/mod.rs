//! Frames of links to rows.

pub(crate) mod messages;
pub(crate) mod receive;
mod tables;
