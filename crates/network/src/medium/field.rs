//! Positions of the nodes, and who is in range of whom.

use crate::error::Error;
use crate::units::SensorId;
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_topology::{Deployment, Graph, Hops};
use nalgebra::Vector2;
use std::f64::consts::TAU;

/// Nodes in the plane with radios of one range.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    positions: Vec<Vector2<f64>>,
    graph: Graph,
    range: f64,
}

impl Field {
    /// The nodes of a deployment with radios that reach `range` metres.
    ///
    /// # Errors
    /// If `range` is not a positive number.
    pub fn new(deployment: &Deployment, range: f64) -> Result<Self, Error> {
        Ok(Self {
            graph: Graph::within(deployment.positions(), range)?,
            positions: deployment.positions().to_vec(),
            range,
        })
    }

    /// Node 0 in the middle and `sensors` around it on a circle of the given radius, all in range of each other.
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

    /// `nodes` nodes on a circle of the given radius, all in range of each other.
    ///
    /// # Errors
    /// If there is no node or the radius is not a positive number.
    pub fn ring(nodes: usize, radius: f64) -> Result<Self, Error> {
        let star = Self::star(nodes, radius)?;
        Self::new(&Deployment::given(star.positions[1..].to_vec())?, star.range)
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Never true: a deployment has at least one node.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Range of the radios, metres.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// The neighbour graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Distance between two nodes that exist, metres.
    pub(crate) fn distance(&self, from: u32, to: u32) -> f64 {
        (self.positions[from as usize] - self.positions[to as usize]).norm()
    }

    /// # Errors
    /// [`Error::UnknownNode`].
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
    /// [`Error::UnknownNode`]; [`Error::Unheard`] if there are other nodes and none is in range of it.
    pub(crate) fn check_heard(&self, node: SensorId) -> Result<(), Error> {
        self.check(node)?;
        if self.len() > 1 && self.graph.neighbours(node.index()).is_empty() {
            let (node, range) = (node.index(), self.range);
            return Err(Error::Unheard { node, range });
        }
        Ok(())
    }

    /// Routes from a node to all others.
    ///
    /// # Errors
    /// [`Error::UnknownNode`]; [`Error::Disconnected`] if one is not reached.
    pub fn routes(&self, root: SensorId) -> Result<Hops, Error> {
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
