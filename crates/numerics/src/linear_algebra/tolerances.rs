//! When an entry of a covariance counts as zero. All tolerances are shares of the variances of row and column, so that nothing depends on
//! units; each is above the rounding errors of what it judges.

/// A squared pivot of a correlation matrix that is to be inverted, below which it counts as singular.
pub(crate) const SINGULAR: f64 = 1e-14;
/// A pivot below which a direction of a semidefinite matrix counts as having no variance. Updates have left some rounding in it.
pub(crate) const NO_VARIANCE: f64 = 1e-12;
/// A squared pivot below which equations are solved by the pseudo-inverse: its digits would be those of rounding errors.
pub(crate) const NO_DIGITS: f64 = 1e-11;

/// Asymmetries above this multiple of the product of the standard deviations of row and column are refused.
const SYMMETRY_TOLERANCE: f64 = 1e-9;

/// Whether the entries `(i, j)` and `(j, i)` agree to rounding, relative to the standard deviations of their row and column. All tests of
/// symmetry use this function. A tolerance relative to the largest entry would miss an asymmetry among coordinates of small units.
pub(crate) fn agree(below: f64, above: f64, row: f64, column: f64) -> bool {
    (below / row / column - above / row / column).abs() <= SYMMETRY_TOLERANCE
}
