//! Patterns: the grid of cells, the bit for each cell, and the number of patterns.

pub mod count;
pub(crate) mod grid;
pub(crate) mod linear;
pub(crate) mod pattern;
pub(crate) mod quantizer;
