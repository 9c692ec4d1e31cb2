//! Positions of the nodes, and which nodes are in range of each other.

use crate::error::Error;
use crate::units::SensorId;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_topology::{Deployment, Graph, Hops};
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Largest number of nodes in a list of links.
const MOST_NODES: u32 = 1 << 24;

/// The nodes, and which are in range of each other: from positions in the plane and one radio range, or from a list of links.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    nodes: Nodes,
    graph: Graph,
    range: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Nodes {
    Positions(Vec<Vector2<f64>>),
    /// Length of each link, metres. The key has the smaller node number first.
    Links(BTreeMap<(u32, u32), f64>),
}

impl Field {
    /// The nodes of a deployment with radios that reach `range` metres.
    ///
    /// # Errors
    /// If `range` is not a positive number.
    pub fn new(deployment: &Deployment, range: f64) -> Result<Self, Error> {
        Ok(Self {
            graph: Graph::within(deployment.positions(), range)?,
            nodes: Nodes::Positions(deployment.positions().to_vec()),
            range,
        })
    }

    /// The nodes of a list of links as CSV with the columns `from,to,metres`. Nodes are numbered from 0; each link works in both
    /// directions. The metres may be missing and are then 1. A first line that does not begin with a digit is a header; empty lines are
    /// skipped.
    ///
    /// # Errors
    /// If a line is not a link, joins a node to itself or repeats a link, or there is no link.
    pub fn from_csv(links: &str) -> Result<Self, Error> {
        let mut lengths = BTreeMap::new();
        for (number, line) in (1..).zip(links.lines().map(str::trim)) {
            // The first line may be a header.
            if line.is_empty() || number == 1 && !line.starts_with(|c: char| c.is_ascii_digit()) {
                continue;
            }
            let refused = |expected| ArgumentError::new("links", format!("`{line}` in line {number}"), expected);
            let mut cells = line.split(',').map(str::trim);
            let mut node = || cells.next().and_then(|cell| cell.parse::<u32>().ok());
            let ends = node().zip(node()).filter(|(a, b)| a.max(b) < &MOST_NODES);
            let (a, b) = ends.ok_or_else(|| refused("two nodes below 2^24, and perhaps metres"))?;
            let metres = cells.next().map_or(Ok(1.0), str::parse::<f64>);
            let metres = metres
                .ok()
                .filter(|metres| metres.is_finite() && *metres > 0.0 && cells.next().is_none());
            let metres = metres.ok_or_else(|| refused("metres above 0 as its third and last cell"))?;
            // Links have no direction: the smaller number comes first in the key, and a link given twice is refused.
            if a == b || lengths.insert((a.min(b), a.max(b)), metres).is_some() {
                return Err(refused("each link once, between two nodes").into());
            }
        }
        let last = lengths.keys().map(|(_, b)| *b).max();
        let last = last.ok_or_else(|| ArgumentError::new("links", "none", "one link or more"))?;
        Ok(Self {
            graph: Graph::of_edges(last as usize + 1, lengths.keys().copied())?,
            range: lengths.values().copied().fold(0.0, f64::max),
            nodes: Nodes::Links(lengths),
        })
    }

    /// Node 0 in the middle and `sensors` nodes on a circle of the given radius (metres) around it, all in range of each other.
    ///
    /// # Errors
    /// If there is no sensor or the radius is not a positive number.
    pub fn star(sensors: usize, radius: f64) -> Result<Self, Error> {
        at_least_one("sensors", sensors)?;
        positive("radius", radius)?;
        let around = (0..sensors).map(|i| {
            let angle = TAU * i as f64 / sensors as f64;
            Vector2::new(angle.cos(), angle.sin()) * radius
        });
        let positions = std::iter::once(Vector2::zeros()).chain(around).collect();
        Self::new(&Deployment::given(positions)?, 2.5 * radius)
    }

    /// `nodes` nodes on a circle of the given radius (metres), all in range of each other.
    ///
    /// # Errors
    /// If there is no node or the radius is not a positive number.
    pub fn ring(nodes: usize, radius: f64) -> Result<Self, Error> {
        let star = Self::star(nodes, radius)?;
        match &star.nodes {
            Nodes::Positions(positions) => Self::new(&Deployment::given(positions[1..].to_vec())?, star.range),
            Nodes::Links(_) => Ok(star),
        }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.graph.len()
    }

    /// Never true: a deployment has at least one node.
    pub fn is_empty(&self) -> bool {
        self.graph.is_empty()
    }

    /// Range of the radios, metres. For a list it is the longest link.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// The neighbour graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Distance between two existing nodes, metres. If a list has no link between them, the range.
    pub(crate) fn distance(&self, from: u32, to: u32) -> f64 {
        match &self.nodes {
            Nodes::Positions(positions) => (positions[from as usize] - positions[to as usize]).norm(),
            Nodes::Links(lengths) => *lengths.get(&(from.min(to), from.max(to))).unwrap_or(&self.range),
        }
    }

    /// # Errors
    /// [`Error::UnknownNode`] if there is no such node.
    pub(crate) fn check(&self, node: SensorId) -> Result<(), Error> {
        let (node, nodes) = (node.index(), self.len());
        if node < nodes {
            Ok(())
        } else {
            Err(Error::UnknownNode { node, nodes })
        }
    }

    /// # Errors
    /// [`Error::UnknownNode`], [`Error::SelfLink`], [`Error::OutOfRange`].
    pub(crate) fn check_link(&self, from: SensorId, to: SensorId) -> Result<(), Error> {
        self.check(from)?;
        self.check(to)?;
        if from == to {
            return Err(Error::SelfLink { node: to.index() });
        }
        if self.graph.neighbours(from.index()).binary_search(&to.0).is_err() {
            return Err(Error::OutOfRange {
                from: from.index(),
                to: to.index(),
            });
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::UnknownNode`]; [`Error::Unheard`] if there are other nodes but none is in range of it.
    pub(crate) fn check_heard(&self, node: SensorId) -> Result<(), Error> {
        self.check(node)?;
        if self.len() > 1 && self.graph.neighbours(node.index()).is_empty() {
            let (node, range) = (node.index(), self.range);
            return Err(Error::Unheard { node, range });
        }
        Ok(())
    }

    /// Shortest routes from a node to all others.
    ///
    /// # Errors
    /// [`Error::UnknownNode`]; [`Error::Disconnected`] if a node cannot be reached.
    pub(crate) fn routes(&self, root: SensorId) -> Result<Hops, Error> {
        let hops = self.graph.hops_from(root.index())?;
        let (reached, nodes) = (hops.reached().len(), self.len());
        if reached < nodes {
            let root = root.index();
            return Err(Error::Disconnected { root, reached, nodes });
        }
        Ok(hops)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_links_is_a_field() {
        let field = Field::from_csv("from,to,metres\n0, 1, 12.5\n\n2,1\n").unwrap();
        assert_eq!((field.len(), field.range(), field.distance(1, 0), field.distance(1, 2)), (3, 12.5, 12.5, 1.0));
        assert!(field.check_link(SensorId(0), SensorId(2)).is_err() && field.routes(SensorId(0)).is_ok());
        for (text, part) in [
            ("", "none"),
            ("0,1\n1;2", "`1;2` in line 2"),
            ("0,1,-3", "metres above 0"),
            ("0,1,nan", "metres above 0"),
            ("0,1,2,3", "third and last"),
            ("3,3", "each link once"),
            ("0,1\n1,0", "each link once"),
            ("0,4000000000", "below 2^24"),
        ] {
            let error = Field::from_csv(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn what_is_no_network_is_refused() {
        let line = |x: &[f64]| Deployment::given(x.iter().map(|x| Vector2::new(*x, 0.0)).collect()).unwrap();
        assert!(matches!(Field::new(&line(&[0.0, 1.0]), 0.0), Err(Error::Argument(_))));
        let field = Field::new(&line(&[0.0, 1.0, 5.0]), 2.0).unwrap();
        let link = |from, to| field.check_link(SensorId(from), SensorId(to));
        assert!(link(0, 1).is_ok());
        assert!(matches!(link(1, 1), Err(Error::SelfLink { node: 1 })));
        assert!(matches!(link(0, 2), Err(Error::OutOfRange { from: 0, to: 2 })));
        assert!(matches!(link(0, 9), Err(Error::UnknownNode { node: 9, nodes: 3 })));
        let lost = field.routes(SensorId(0));
        assert!(matches!(
            lost,
            Err(Error::Disconnected {
                root: 0,
                reached: 2,
                nodes: 3
            })
        ));
        assert!(matches!(field.check_heard(SensorId(2)), Err(Error::Unheard { node: 2, .. })));
        assert!(field.check_heard(SensorId(1)).is_ok());
        assert!(Field::star(0, 1.0).is_err() && Field::star(3, 0.0).is_err());
        assert!(Field::star(7, 10.0).unwrap().routes(SensorId(3)).is_ok());
    }
}
