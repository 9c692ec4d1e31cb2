//! Uniform nodes on a line.

use crate::Error;
use fewbits_numerics::error::{finite, positive, refuse};
use serde::{Deserialize, Serialize};

/// Evenly spaced points on a line, the nodes of a trapezoid rule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct UniformGrid {
    lower: f64,
    spacing: f64,
    points: usize,
}

/// The stored form of [`UniformGrid`].
#[derive(Deserialize)]
#[serde(rename = "Grid")]
#[serde(deny_unknown_fields)]
struct Stored {
    lower: f64,
    spacing: f64,
    points: usize,
}

impl TryFrom<Stored> for UniformGrid {
    type Error = Error;

    fn try_from(Stored { lower, spacing, points }: Stored) -> Result<Self, Error> {
        UniformGrid::from_nodes(lower, spacing, points)
    }
}

/// Largest number of nodes of a grid.
const MAX_NODES: usize = 1_000_000;

/// Largest extent of a grid: squares of distances are still finite.
pub(super) const MAX_WIDTH: f64 = 1e153;

impl UniformGrid {
    /// So many nodes from `lower` on, at this distance.
    ///
    /// # Errors
    /// If `lower` is not finite, `spacing` not positive and finite, there are not 2 to a million nodes, or moments of a density on the nodes
    /// could overflow.
    pub fn from_nodes(lower: f64, spacing: f64, points: usize) -> Result<Self, Error> {
        if !(2..=MAX_NODES).contains(&points) {
            return refuse("points", points, format!("2 to {MAX_NODES} nodes"));
        }
        Self::of_nodes(finite("lower", lower)?, spacing, points)
    }

    /// Returns an error if moments of a density on the nodes could overflow. A density is at most the reciprocal of the spacing.
    fn of_nodes(lower: f64, spacing: f64, points: usize) -> Result<Self, Error> {
        let grid = Self {
            lower,
            spacing: positive("spacing", spacing)?,
            points,
        };
        let farthest = lower.abs().max(grid.node(points).abs());
        if !(spacing * points as f64 <= MAX_WIDTH && spacing >= f64::MIN_POSITIVE && farthest / spacing <= 1e300) {
            let expected = "a spacing that keeps the grid below 1e153 and above the rounding of its reciprocal";
            return refuse("spacing", format!("{spacing} from {lower}"), expected);
        }
        Ok(grid)
    }

    /// Nodes from `lower` to `upper`, `spacing` apart. The last node may be beyond `upper` by less than `spacing`.
    ///
    /// # Errors
    /// If a bound is not finite, `lower < upper` does not hold, the spacing is not positive, there are more than a million nodes, or
    /// moments over them would overflow.
    pub fn new(lower: f64, upper: f64, spacing: f64) -> Result<Self, Error> {
        finite("lower", lower)?;
        finite("upper", upper)?;
        positive("spacing", spacing)?;
        let intervals = ((upper - lower) / spacing).ceil();
        if !(1.0..MAX_NODES as f64).contains(&intervals) {
            let expected = "an interval that holds 1 to a million spacings";
            return refuse("grid", format!("[{lower:?}, {upper:?}] by {spacing:?}"), expected);
        }
        Self::of_nodes(lower, spacing, intervals as usize + 1)
    }

    /// Nodes symmetric about zero, zero included, out to `half_width` or beyond by less than `spacing`.
    ///
    /// # Errors
    /// As [`UniformGrid::new`].
    pub fn symmetric(half_width: f64, spacing: f64) -> Result<Self, Error> {
        let half = (positive("half_width", half_width)? / positive("spacing", spacing)?).ceil() * spacing;
        let mut grid = Self::new(-half, half, spacing)?;
        // Constructed from the number of nodes on one side, so that rounding of the quotient cannot break the symmetry.
        grid.points = 2 * (half / spacing).round() as usize + 1;
        Ok(grid)
    }

    /// Number of nodes.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Distance between neighbouring nodes.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Position of node `i`.
    #[inline]
    pub fn node(&self, i: usize) -> f64 {
        self.lower + i as f64 * self.spacing
    }

    /// Positions of all nodes, increasing.
    pub fn nodes(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.points).map(|i| self.node(i))
    }

    /// Indices of the nodes in `[lower, upper]`.
    #[inline]
    pub fn indices_within(&self, lower: f64, upper: f64) -> std::ops::Range<usize> {
        let from = ((lower - self.lower) / self.spacing).ceil().max(0.0) as usize;
        let to = ((upper - self.lower) / self.spacing).floor() + 1.0;
        let to = (to.max(0.0) as usize).min(self.points);
        from.min(to)..to
    }
}
