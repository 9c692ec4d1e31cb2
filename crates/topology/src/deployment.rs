//! Where sensors stand.

use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, finite, positive, within};
use nalgebra::Vector2;
use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// Candidates around a Poisson-disk point before it is given up, as Bridson chose.
const CANDIDATES: usize = 30;
/// The most grid cells of a Poisson-disk deployment.
const MOST_CELLS: f64 = 1e8;

/// Positions of nodes in the plane, in metres: at least one, all finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Deployment {
    positions: Vec<Vector2<f64>>,
}

impl Deployment {
    /// The given positions.
    ///
    /// # Errors
    /// If there is none, or a coordinate is not finite.
    pub fn given(positions: Vec<Vector2<f64>>) -> Result<Self, Error> {
        at_least_one("positions", positions.len())?;
        for position in &positions {
            finite("positions", position.x)?;
            finite("positions", position.y)?;
        }
        Ok(Self { positions })
    }

    /// `nodes` independent uniform positions in the rectangle between two corners.
    ///
    /// # Errors
    /// If `nodes` is zero or `upper` does not exceed `lower`.
    pub fn uniform<R: Rng + ?Sized>(
        rng: &mut R,
        lower: [f64; 2],
        upper: [f64; 2],
        nodes: usize,
    ) -> Result<Self, Error> {
        rectangle(lower, upper)?;
        at_least_one("nodes", nodes)?;
        Self::given((0..nodes).map(|_| draw(rng, lower, upper)).collect())
    }

    /// A regular grid with nodes on the border; `counts` nodes along x and y. A single node of an axis stands in the middle.
    ///
    /// # Errors
    /// If a count is zero or `upper` does not exceed `lower`.
    pub fn grid(lower: [f64; 2], upper: [f64; 2], counts: [usize; 2]) -> Result<Self, Error> {
        rectangle(lower, upper)?;
        at_least_one("counts", counts[0])?;
        at_least_one("counts", counts[1])?;
        let at = |axis: usize, i: usize| {
            let share = if counts[axis] == 1 {
                0.5
            } else {
                i as f64 / (counts[axis] - 1) as f64
            };
            lower[axis] + share * (upper[axis] - lower[axis])
        };
        Self::given(
            (0..counts[1])
                .flat_map(|j| (0..counts[0]).map(move |i| (i, j)))
                .map(|(i, j)| Vector2::new(at(0, i), at(1, j)))
                .collect(),
        )
    }

    /// A grid of `counts` cells with one node uniformly in the middle part of each: `jitter` = 1 fills the cell, 0 is the grid
    /// of cell centres.
    ///
    /// # Errors
    /// If a count is zero, `upper` does not exceed `lower`, or `jitter` is outside `[0, 1]`.
    pub fn jittered_grid<R: Rng + ?Sized>(
        rng: &mut R,
        lower: [f64; 2],
        upper: [f64; 2],
        counts: [usize; 2],
        jitter: f64,
    ) -> Result<Self, Error> {
        rectangle(lower, upper)?;
        at_least_one("counts", counts[0])?;
        at_least_one("counts", counts[1])?;
        within("jitter", jitter, 0.0, 1.0)?;
        let step = [
            (upper[0] - lower[0]) / counts[0] as f64,
            (upper[1] - lower[1]) / counts[1] as f64,
        ];
        let mut positions = Vec::with_capacity(counts[0] * counts[1]);
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                let mut at = |axis: usize, index: usize| {
                    lower[axis] + step[axis] * (index as f64 + 0.5 + jitter * (rng.random::<f64>() - 0.5))
                };
                let x = at(0, i);
                positions.push(Vector2::new(x, at(1, j)));
            }
        }
        Self::given(positions)
    }

    /// Positions no two of which are closer than `distance`, as dense as random trials make it (Bridson, SIGGRAPH sketches
    /// 2007): time linear in the number of nodes.
    ///
    /// # Errors
    /// If `upper` does not exceed `lower`, `distance` is not a positive number, or the field is more than about 10^4 distances
    /// wide and high.
    pub fn poisson_disk<R: Rng + ?Sized>(
        rng: &mut R,
        lower: [f64; 2],
        upper: [f64; 2],
        distance: f64,
    ) -> Result<Self, Error> {
        rectangle(lower, upper)?;
        positive("distance", distance)?;
        // A cell of this size holds at most one node.
        let size = distance / std::f64::consts::SQRT_2;
        let extent = [upper[0] - lower[0], upper[1] - lower[1]];
        if (extent[0] / size + 1.0) * (extent[1] / size + 1.0) > MOST_CELLS {
            return Err(ArgumentError::new("distance", distance, "a distance that 10^8 cells resolve").into());
        }
        let columns = (extent[0] / size) as usize + 1;
        let rows = (extent[1] / size) as usize + 1;
        let cell = |p: &Vector2<f64>| [((p.x - lower[0]) / size) as usize, ((p.y - lower[1]) / size) as usize];
        let mut grid = vec![u32::MAX; columns * rows];
        let first = draw(rng, lower, upper);
        let mut positions = vec![first];
        let [i, j] = cell(&first);
        grid[j * columns + i] = 0;
        let mut active = vec![0_usize];
        while !active.is_empty() {
            let chosen = rng.random_range(0..active.len());
            let centre = positions[active[chosen]];
            let found = (0..CANDIDATES).find_map(|_| {
                let angle = TAU * rng.random::<f64>();
                // Uniform in the ring between one and two distances.
                let radius = distance * (1.0 + 3.0 * rng.random::<f64>()).sqrt();
                let p = centre + Vector2::new(angle.cos(), angle.sin()) * radius;
                let inside = (lower[0]..=upper[0]).contains(&p.x) && (lower[1]..=upper[1]).contains(&p.y);
                if !inside {
                    return None;
                }
                let [i, j] = cell(&p);
                let crowded = (j.saturating_sub(2)..(j + 3).min(rows)).any(|row| {
                    (i.saturating_sub(2)..(i + 3).min(columns)).any(|column| {
                        let other = grid[row * columns + column];
                        other != u32::MAX && (positions[other as usize] - p).norm_squared() < distance * distance
                    })
                });
                (!crowded).then_some(p)
            });
            match found {
                Some(p) => {
                    let [i, j] = cell(&p);
                    grid[j * columns + i] = positions.len() as u32;
                    active.push(positions.len());
                    positions.push(p);
                }
                None => {
                    active.swap_remove(chosen);
                }
            }
        }
        Self::given(positions)
    }

    /// Positions, in order of their index.
    pub fn positions(&self) -> &[Vector2<f64>] {
        &self.positions
    }

    /// Number of nodes, at least one.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Never true: a deployment has at least one node.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Index of the node nearest to a point; the lowest among equals.
    pub fn nearest_to(&self, point: &Vector2<f64>) -> usize {
        let mut best = (f64::INFINITY, 0);
        for (i, position) in self.positions.iter().enumerate() {
            let squared = (position - point).norm_squared();
            if squared < best.0 {
                best = (squared, i);
            }
        }
        best.1
    }

    /// The same deployment with one node elsewhere.
    ///
    /// # Errors
    /// If the node does not exist or the point is not finite.
    pub fn with_moved(mut self, node: usize, to: Vector2<f64>) -> Result<Self, Error> {
        finite("to", to.x)?;
        finite("to", to.y)?;
        let nodes = self.len();
        *self.positions.get_mut(node).ok_or(Error::NoSuchNode { node, nodes })? = to;
        Ok(self)
    }
}

fn rectangle(lower: [f64; 2], upper: [f64; 2]) -> Result<(), ArgumentError> {
    for axis in 0..2 {
        finite("lower", lower[axis])?;
        finite("upper", upper[axis])?;
        positive("upper - lower", upper[axis] - lower[axis])?;
    }
    Ok(())
}

fn draw<R: Rng + ?Sized>(rng: &mut R, lower: [f64; 2], upper: [f64; 2]) -> Vector2<f64> {
    Vector2::from_fn(|axis, _| lower[axis] + rng.random::<f64>() * (upper[axis] - lower[axis]))
}
