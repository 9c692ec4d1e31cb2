//! Rows as frames over links, and back.

pub(crate) mod receive;
pub(crate) mod send;
mod tables;
