//! The graph of nodes that are in range of each other.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, positive, refuse};
use nalgebra::Vector2;

/// An undirected graph in compressed sparse rows: the neighbours of each node, in increasing order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    /// Joins nodes that are at most `range` apart, by lists of the nodes in each cell of a grid of that size.
    ///
    /// Time and memory are linear in nodes plus edges. A field that is far larger than the range times the root of the number of
    /// nodes gets larger cells, so that their number stays of the order of the number of nodes.
    ///
    /// # Errors
    /// If a coordinate is not finite, `range` is not a positive number, or there are 2^32 nodes or more.
    pub fn within(positions: &[Vector2<f64>], range: f64) -> Result<Self, ArgumentError> {
        positive("range", range)?;
        let count = u32::try_from(positions.len())
            .map_err(|_| ArgumentError::new("positions", positions.len(), "fewer than 2^32 nodes"))?;
        for position in positions {
            all_finite("positions", position.as_slice())?;
        }
        if positions.is_empty() {
            return Ok(Self {
                starts: vec![0],
                neighbours: Vec::new(),
            });
        }
        let cells = Cells::new(positions, range, count);
        // A power of two: squares neither overflow nor underflow, and scaling does not round.
        let scale = 2.0_f64.powi(-(range.log2().floor().clamp(-1000.0, 1000.0) as i32));
        let limit = (range * scale) * (range * scale);
        let mut starts = Vec::with_capacity(positions.len() + 1);
        let mut neighbours = Vec::new();
        starts.push(0);
        for position in positions {
            let from = neighbours.len();
            cells.visit_around(position, |other| {
                if ((positions[other as usize] - position) * scale).norm_squared() <= limit {
                    neighbours.push(other);
                }
            });
            // The node itself is among the nodes found: its distance is zero.
            let own = (starts.len() - 1) as u32;
            neighbours[from..].sort_unstable();
            if let Ok(at) = neighbours[from..].binary_search(&own) {
                neighbours.remove(from + at);
            }
            starts.push(neighbours.len());
        }
        neighbours.shrink_to_fit();
        Ok(Self { starts, neighbours })
    }

    /// Joins the given pairs of `nodes` nodes, in both directions. A pair may be given more than once.
    ///
    /// # Errors
    /// If a node of a pair does not exist, or is joined to itself.
    pub fn of_edges(nodes: usize, edges: impl IntoIterator<Item = (u32, u32)>) -> Result<Self, ArgumentError> {
        let mut lists = vec![Vec::new(); nodes];
        for (a, b) in edges {
            if a == b {
                return refuse("edges", format!("{a} to {b}"), "two different nodes");
            }
            for (from, to) in [(a, b), (b, a)] {
                let node = from as usize;
                lists.get_mut(node).ok_or_else(|| no_such_node(node, nodes))?.push(to);
            }
        }
        let (mut starts, mut neighbours) = (vec![0], Vec::new());
        for mut list in lists {
            list.sort_unstable();
            list.dedup();
            neighbours.append(&mut list);
            starts.push(neighbours.len());
        }
        Ok(Self { starts, neighbours })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of undirected edges.
    pub fn edges(&self) -> usize {
        self.neighbours.len() / 2
    }

    /// Neighbours of `node` in increasing order; empty if there is no such node.
    pub fn neighbours(&self, node: usize) -> &[u32] {
        match (self.starts.get(node), self.starts.get(node + 1)) {
            (Some(from), Some(to)) => &self.neighbours[*from..*to],
            _ => &[],
        }
    }

    /// # Errors
    /// If `node` does not exist.
    pub(crate) fn check(&self, node: usize) -> Result<(), ArgumentError> {
        let nodes = self.len();
        if node < nodes {
            Ok(())
        } else {
            Err(no_such_node(node, nodes))
        }
    }
}

pub(crate) fn no_such_node(node: usize, nodes: usize) -> ArgumentError {
    ArgumentError::new("node", node, format!("an index below {nodes}, the number of nodes"))
}

/// Nodes sorted by the grid cell that contains them.
struct Cells {
    lower: Vector2<f64>,
    size: f64,
    counts: [usize; 2],
    starts: Vec<u32>,
    nodes: Vec<u32>,
}

impl Cells {
    fn new(positions: &[Vector2<f64>], range: f64, count: u32) -> Self {
        let (mut lower, mut upper) = (positions[0], positions[0]);
        for position in positions {
            lower = lower.inf(position);
            upper = upper.sup(position);
        }
        let extent = upper - lower;
        // At most about four cells per node in each direction that has an extent.
        let most = (2.0 * f64::from(count).sqrt()).max(1.0);
        let long = 4.0 * f64::from(count);
        let thin = extent.x.min(extent.y) < range;
        let size = range.max(extent.max() / if thin { long } else { most });
        let counts = [(extent.x / size) as usize + 1, (extent.y / size) as usize + 1];
        let mut cells = Self {
            lower,
            size,
            counts,
            starts: vec![0; counts[0] * counts[1] + 1],
            nodes: vec![0; positions.len()],
        };
        let home: Vec<u32> = positions.iter().map(|p| cells.index(cells.of(p)) as u32).collect();
        for cell in &home {
            cells.starts[*cell as usize + 1] += 1;
        }
        for i in 1..cells.starts.len() {
            cells.starts[i] += cells.starts[i - 1];
        }
        let mut next = cells.starts.clone();
        for (node, cell) in home.iter().enumerate() {
            let slot = &mut next[*cell as usize];
            cells.nodes[*slot as usize] = node as u32;
            *slot += 1;
        }
        cells
    }

    fn of(&self, position: &Vector2<f64>) -> [usize; 2] {
        let scaled = (position - self.lower) / self.size;
        [
            (scaled.x as usize).min(self.counts[0] - 1),
            (scaled.y as usize).min(self.counts[1] - 1),
        ]
    }

    fn index(&self, cell: [usize; 2]) -> usize {
        cell[1] * self.counts[0] + cell[0]
    }

    fn visit_around(&self, position: &Vector2<f64>, mut visit: impl FnMut(u32)) {
        let [i, j] = self.of(position);
        for row in j.saturating_sub(1)..(j + 2).min(self.counts[1]) {
            let from = self.index([i.saturating_sub(1), row]);
            let to = self.index([(i + 1).min(self.counts[0] - 1), row]);
            let (from, to) = (self.starts[from] as usize, self.starts[to + 1] as usize);
            self.nodes[from..to].iter().for_each(|node| visit(*node));
        }
    }
}
