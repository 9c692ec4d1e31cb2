//! Positions of sensors.

use crate::graph::no_such_node;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, finite, positive};
use nalgebra::Vector2;
use rand::{Rng, RngExt};

/// Positions of nodes in the plane, in metres: at least one, all finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Deployment {
    positions: Vec<Vector2<f64>>,
}

impl Deployment {
    /// The given positions.
    ///
    /// # Errors
    /// If there is no position, or a coordinate is not finite.
    pub fn given(positions: Vec<Vector2<f64>>) -> Result<Self, ArgumentError> {
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
    ) -> Result<Self, ArgumentError> {
        rectangle(lower, upper)?;
        at_least_one("nodes", nodes)?;
        Self::given((0..nodes).map(|_| draw(rng, lower, upper)).collect())
    }

    /// A regular grid with nodes on the border; `counts` nodes along x and y. A single node of an axis stands in the middle.
    ///
    /// # Errors
    /// If a count is zero or `upper` does not exceed `lower`.
    pub fn grid(lower: [f64; 2], upper: [f64; 2], counts: [usize; 2]) -> Result<Self, ArgumentError> {
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

    /// Positions, in order of their index.
    pub fn positions(&self) -> &[Vector2<f64>] {
        &self.positions
    }

    /// Number of nodes, at least one.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Index of the node nearest to a point; the lowest index in a tie.
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
    pub fn with_moved(mut self, node: usize, to: Vector2<f64>) -> Result<Self, ArgumentError> {
        finite("to", to.x)?;
        finite("to", to.y)?;
        let nodes = self.len();
        *self.positions.get_mut(node).ok_or_else(|| no_such_node(node, nodes))? = to;
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
