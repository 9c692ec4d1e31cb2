//! Cells of the measurement axis.

use crate::Error;
use crate::observation::source::Source;
use fewbits_numerics::error::{positive, refuse};
use fewbits_quantizers::quantizer::{cell_of, check_increasing};
use serde::{Deserialize, Serialize};

/// Largest number of bits of a cell index.
pub(crate) const MAX_BITS: usize = 16;

/// Interior edges `t_1 < ... < t_{L-1}` that divide the axis into `L` cells; the outer cells are unbounded.
///
/// For a bounded source the unbounded outer cells have the effect of clipping: a measurement below `-V` is treated as `-V`, one above
/// `V` as `V` (section 5.2 of the thesis prints the two sides exchanged; erratum `binary-1`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct CellGrid {
    breakpoints: Vec<f64>,
}

impl TryFrom<Vec<f64>> for CellGrid {
    type Error = Error;

    fn try_from(breakpoints: Vec<f64>) -> Result<Self, Error> {
        Self::from_breakpoints(breakpoints)
    }
}

impl From<CellGrid> for Vec<f64> {
    fn from(grid: CellGrid) -> Self {
        grid.breakpoints
    }
}

impl CellGrid {
    /// The grid of `2^bits` cells with edges at multiples of `2 V / 2^bits` from `-V`.
    ///
    /// # Errors
    /// If `half_width` is not positive and finite or `bits` not in `1..=16`.
    pub fn uniform(half_width: f64, bits: usize) -> Result<Self, Error> {
        let half_width = positive("half_width", half_width)?;
        let cells = 1usize << bits_in_range(bits)?;
        // Symmetric by construction, so that the middle edge is exactly zero.
        let breakpoints = (1..cells)
            .map(|l| half_width * ((2.0 * l as f64 - cells as f64) / cells as f64))
            .collect();
        Ok(Self { breakpoints })
    }

    /// A grid with any strictly increasing finite interior edges, at least one.
    ///
    /// # Errors
    /// If the edges are empty, not finite or not strictly increasing.
    pub fn from_breakpoints(breakpoints: Vec<f64>) -> Result<Self, Error> {
        if breakpoints.is_empty() {
            return refuse("breakpoints", "empty", "at least one breakpoint");
        }
        check_increasing(&breakpoints)?;
        Ok(Self { breakpoints })
    }

    /// The `2^bits` cells of the Lloyd-Max quantizer of `N(0, deviation^2)`.
    ///
    /// # Errors
    /// If `deviation` is not positive and finite or `bits` not in `1..=8`.
    pub fn lloyd_max(deviation: f64, bits: usize) -> Result<Self, Error> {
        let deviation = positive("deviation", deviation)?;
        let table = fewbits_quantizers::lloyd_max::gaussian_table(bits_in_range(bits)?)?;
        Self::from_breakpoints(table.breakpoints().iter().map(|t| t * deviation).collect())
    }

    /// The interior edges.
    pub fn breakpoints(&self) -> &[f64] {
        &self.breakpoints
    }

    /// Number of cells `L`.
    pub fn cells(&self) -> usize {
        self.breakpoints.len() + 1
    }

    /// Number of bits of a cell index; `None` if `L` is not a power of two.
    pub fn bits(&self) -> Option<usize> {
        self.cells()
            .is_power_of_two()
            .then(|| self.cells().trailing_zeros() as usize)
    }

    /// Index, from 0, of the cell that contains a measurement: the number of edges at or below it.
    ///
    /// # Errors
    /// If the measurement is NaN.
    pub fn locate(&self, measurement: f64) -> Result<usize, Error> {
        cell_of(&self.breakpoints, measurement)
    }

    /// Limits of cell `l`, restricted to the support of the source; `None` if the two do not overlap.
    #[doc(hidden)]
    pub fn support(&self, cell: usize, source: &Source) -> Option<(f64, f64)> {
        let reach = source.reach();
        let low = if cell == 0 {
            -reach
        } else {
            self.breakpoints[cell - 1].max(-reach)
        };
        let high = self.breakpoints.get(cell).copied().unwrap_or(reach).min(reach);
        (low < high).then_some((low, high))
    }
}

/// Accepts a number of bits for which patterns can be enumerated.
///
/// # Errors
/// If `bits` is zero or more than 16.
pub fn bits_in_range(bits: usize) -> Result<usize, Error> {
    if (1..=MAX_BITS).contains(&bits) {
        Ok(bits)
    } else {
        refuse("bits", bits, "a number of bits in 1..=16")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn uniform_edges_are_symmetric() {
        let grid = CellGrid::uniform(0.7, 4).unwrap();
        assert_eq!((grid.cells(), grid.bits()), (16, Some(4)));
        assert!((0..15).all(|l| grid.breakpoints()[l] == -grid.breakpoints()[14 - l]));
        assert_relative_eq!(grid.breakpoints()[0], -0.7 + 1.4 / 16.0, max_relative = 1e-14);
    }

    #[test]
    fn measurements_clip_to_the_outer_cells() {
        let grid = CellGrid::uniform(1.0, 3).unwrap();
        assert_eq!(grid.locate(f64::NEG_INFINITY).unwrap(), 0);
        assert_eq!(grid.locate(-7.0).unwrap(), 0);
        assert_eq!(grid.locate(0.0).unwrap(), 4);
        assert_eq!(grid.locate(f64::INFINITY).unwrap(), 7);
        assert!(grid.locate(f64::NAN).is_err());
    }

    #[test]
    fn lloyd_max_cells_scale_with_the_deviation() {
        let table = fewbits_quantizers::lloyd_max::gaussian_table(3).unwrap();
        let grid = CellGrid::lloyd_max(0.7, 3).unwrap();
        for (edge, standard) in grid.breakpoints().iter().zip(table.breakpoints()) {
            assert_relative_eq!(*edge, 0.7 * standard, max_relative = 1e-15);
        }
    }

    #[test]
    fn bad_grids_are_refused() {
        assert!(CellGrid::uniform(1.0, 0).is_err());
        assert!(CellGrid::uniform(1.0, 17).is_err());
        assert!(CellGrid::uniform(f64::NAN, 3).is_err());
        assert!(CellGrid::from_breakpoints(vec![]).is_err());
        assert!(CellGrid::from_breakpoints(vec![0.0, 0.0]).is_err());
        assert!(CellGrid::from_breakpoints(vec![f64::NEG_INFINITY, 0.0]).is_err());
    }
}
