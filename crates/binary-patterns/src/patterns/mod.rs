//! Patterns: the grid of cells, and the bit for each cell.

pub(crate) mod grid;
pub(crate) mod linear;
pub(crate) mod pattern;
pub(crate) mod quantizer;
