//! Rectilinear grids.

use crate::Error;
use fewbits_numerics::error::{at_least_one, positive, refuse};

/// Largest coordinate, diffusivity, velocity and decay in SI units, and reciprocal of the smallest width and diffusivity. Products of such
/// numbers do not overflow.
pub(crate) const MAX_MAGNITUDE: f64 = 1e30;

/// A rectilinear grid: boxes of any widths along one, two or three axes.
///
/// Cells are numbered with the first axis fastest. A missing axis has one cell from 0 to 1 m: amounts in a plane are per metre
/// of height, and coordinates along that axis are ignored.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    edges: [Vec<f64>; 3],
    dimension: usize,
}

impl Grid {
    /// A grid from the increasing edges of its cells, m, along one to three axes. An axis has one edge more than cells.
    ///
    /// # Errors
    /// If there are not one to three axes, an axis has fewer than two edges, an edge is beyond 1e30 m, or edges do not increase by at
    /// least 1e-30 m.
    pub fn new(edges: &[Vec<f64>]) -> Result<Self, Error> {
        let increase = |axis: &Vec<f64>| {
            let apart = axis.windows(2).all(|pair| pair[1] - pair[0] >= MAX_MAGNITUDE.recip());
            axis.len() >= 2 && apart && axis.iter().all(|edge| edge.abs() <= MAX_MAGNITUDE)
        };
        if !(1..=3).contains(&edges.len()) || !edges.iter().all(increase) {
            let expected = "one to three axes of two or more increasing numbers from -1e30 to 1e30";
            return refuse("edges", format!("{edges:?}"), expected);
        }
        let axis = |i: usize| edges.get(i).cloned().unwrap_or_else(|| vec![0.0, 1.0]);
        Ok(Self {
            edges: [axis(0), axis(1), axis(2)],
            dimension: edges.len(),
        })
    }

    /// A grid of equal cells of the given width, m, with one corner at the origin. `counts` has the number of cells of one to three axes.
    ///
    /// # Errors
    /// If there are not one to three counts, one is zero, or `width` is not a positive number.
    pub fn uniform(counts: &[usize], width: f64) -> Result<Self, Error> {
        positive("width", width)?;
        counts.iter().try_for_each(|n| at_least_one("counts", *n).map(drop))?;
        let axis = |n: &usize| (0..=*n).map(|i| i as f64 * width).collect();
        Self::new(&counts.iter().map(axis).collect::<Vec<Vec<f64>>>())
    }

    /// Number of axes.
    pub(crate) fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of cells along each axis.
    pub fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.edges[axis].len() - 1)
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.counts().iter().product()
    }

    /// Edges of the cells along an axis, m.
    pub fn edges(&self, axis: usize) -> &[f64] {
        &self.edges[axis]
    }

    /// Number of the cell in the given column, line and layer.
    #[inline]
    pub fn index(&self, [column, line, layer]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.counts();
        column + nx * (line + ny * layer)
    }

    /// Column, line and layer of a cell.
    #[inline]
    pub fn place(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts();
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Width of the cells in one column (line, layer) of an axis, m.
    #[inline]
    pub(crate) fn width(&self, axis: usize, at: usize) -> f64 {
        self.edges[axis][at + 1] - self.edges[axis][at]
    }

    /// Centre of a cell, m.
    pub fn centre(&self, cell: usize) -> [f64; 3] {
        let at = self.place(cell);
        [0, 1, 2].map(|axis| 0.5 * (self.edges[axis][at[axis]] + self.edges[axis][at[axis] + 1]))
    }

    /// Volume of a cell, m^3; its area in a plane, its length on a line.
    pub(crate) fn volume(&self, cell: usize) -> f64 {
        self.across(self.place(cell), None)
    }

    /// Product of a cell's widths along all axes except `without`: the area of its faces across that axis.
    pub(crate) fn across(&self, at: [usize; 3], without: Option<usize>) -> f64 {
        let axes = (0..3).filter(|axis| Some(*axis) != without);
        axes.map(|axis| self.width(axis, at[axis])).product()
    }

    /// The place above or below along an axis, if it is on the grid.
    #[inline]
    pub(crate) fn next(&self, mut at: [usize; 3], axis: usize, upper: bool) -> Option<[usize; 3]> {
        at[axis] = if upper { at[axis] + 1 } else { at[axis].checked_sub(1)? };
        (at[axis] + 1 < self.edges[axis].len()).then_some(at)
    }

    /// The cells of a block, given by its first and last place along each axis.
    pub(crate) fn block(&self, [x, y, z]: [(usize, usize); 3]) -> impl Iterator<Item = usize> {
        let lines = (z.0..=z.1).flat_map(move |k| (y.0..=y.1).map(move |j| [j, k]));
        lines.flat_map(move |[j, k]| (x.0..=x.1).map(move |i| self.index([i, j, k])))
    }

    /// Index along an axis of the cell that contains a coordinate. On a face it is the upper cell, at the end of the grid the last one.
    pub(crate) fn along(&self, axis: usize, coordinate: f64) -> Option<usize> {
        if axis >= self.dimension {
            return Some(0);
        }
        let edges = &self.edges[axis];
        let last = edges.len() - 1;
        if !(edges[0]..=edges[last]).contains(&coordinate) {
            return None;
        }
        Some(edges.partition_point(|edge| *edge <= coordinate).clamp(1, last) - 1)
    }

    /// The cell that holds a point, m. A point on the face between two cells belongs to the upper one. `None` outside the grid.
    pub(crate) fn cell_at(&self, point: [f64; 3]) -> Option<usize> {
        let at = [0, 1, 2].map(|axis| self.along(axis, point[axis]));
        Some(self.index([at[0]?, at[1]?, at[2]?]))
    }
}
