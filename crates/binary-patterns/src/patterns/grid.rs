//! Cells of the measurement axis.

use crate::Error;
use crate::observation::source::Source;
use fewbits_numerics::error::{positive, refuse};
use fewbits_quantizers::Quantizer;

/// Largest number of bits of a cell index.
pub(crate) const MAX_BITS: usize = 16;

/// The quantizer whose `2^bits` cells have edges at multiples of `2 V / 2^bits` from `-V`, the outer cells unbounded.
///
/// For a bounded source the unbounded outer cells have the effect of clipping: a measurement below `-V` is treated as `-V`, one above
/// `V` as `V` (section 5.2 of the thesis prints the two sides exchanged; erratum `binary-1`).
///
/// # Errors
/// If `half_width` is not positive and finite or `bits` not in `1..=16`.
pub fn uniform_cells(half_width: f64, bits: usize) -> Result<Quantizer, Error> {
    let half_width = positive("half_width", half_width)?;
    let cells = 1usize << bits_in_range(bits)?;
    // Symmetric by construction, so that the middle edge is exactly zero.
    let breakpoints = (1..cells).map(|l| half_width * ((2.0 * l as f64 - cells as f64) / cells as f64));
    Quantizer::new(breakpoints.collect())
}

/// Limits of cell `l`, restricted to the support of the source; `None` if the two do not overlap.
pub fn support(grid: &Quantizer, cell: usize, source: &Source) -> Option<(f64, f64)> {
    let ((low, high), reach) = (grid.edges(cell), source.reach());
    let (low, high) = (low.max(-reach), high.min(reach));
    (low < high).then_some((low, high))
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
        let grid = uniform_cells(0.7, 4).unwrap();
        assert_eq!(grid.cells(), 16);
        assert!((0..15).all(|l| grid.breakpoints()[l] == -grid.breakpoints()[14 - l]));
        assert_relative_eq!(grid.breakpoints()[0], -0.7 + 1.4 / 16.0, max_relative = 1e-14);
    }

    #[test]
    fn measurements_clip_to_the_outer_cells() {
        let grid = uniform_cells(1.0, 3).unwrap();
        assert_eq!(grid.encode(f64::NEG_INFINITY).unwrap(), 0);
        assert_eq!(grid.encode(-7.0).unwrap(), 0);
        assert_eq!(grid.encode(0.0).unwrap(), 4);
        assert_eq!(grid.encode(f64::INFINITY).unwrap(), 7);
        assert!(grid.encode(f64::NAN).is_err());
    }

    #[test]
    fn bad_grids_are_refused() {
        assert!(uniform_cells(1.0, 0).is_err());
        assert!(uniform_cells(1.0, 17).is_err());
        assert!(uniform_cells(f64::NAN, 3).is_err());
    }
}
