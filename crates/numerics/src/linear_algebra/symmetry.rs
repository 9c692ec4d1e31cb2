//! The one test of symmetry.

/// Asymmetries above this multiple of the product of the standard deviations of row and column are refused.
const SYMMETRY_TOLERANCE: f64 = 1e-9;

/// Whether the entries `(i, j)` and `(j, i)` agree to rounding, relative to the standard deviations of their row and column. All tests of
/// symmetry use this function. A tolerance relative to the largest entry would miss an asymmetry among coordinates of small units.
pub(crate) fn agree(below: f64, above: f64, row: f64, column: f64) -> bool {
    (below / row / column - above / row / column).abs() <= SYMMETRY_TOLERANCE
}
