//! Frames of links to rows.

pub(crate) mod receive;
mod tables;
