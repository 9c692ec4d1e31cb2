//! Patterns of cells: the grid, which bit is sent from which cell, and how many patterns there are.

pub mod count;
pub(crate) mod grid;
pub(crate) mod linear;
pub(crate) mod pattern;
pub(crate) mod quantizer;
