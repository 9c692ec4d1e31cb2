//! Distances in hops, routes, connected components.

use crate::Graph;
use fewbits_numerics::ArgumentError;

const UNREACHED: u32 = u32::MAX;

/// Distances in hops from one node, and the routing tree that they form. The parent of a node is the lowest-numbered neighbour
/// that is one hop nearer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hops {
    distances: Vec<u32>,
    parents: Vec<u32>,
    /// Reached nodes, by increasing distance.
    order: Vec<u32>,
}

impl Hops {
    /// Hops to `node`; `None` if there is no route.
    pub fn distance(&self, node: usize) -> Option<usize> {
        self.distances
            .get(node)
            .filter(|d| **d != UNREACHED)
            .map(|d| *d as usize)
    }

    /// The next node from `node` towards the root; `None` at the root and if there is no route.
    pub fn parent(&self, node: usize) -> Option<usize> {
        self.parents.get(node).filter(|p| **p != UNREACHED).map(|p| *p as usize)
    }

    /// Reached nodes, the root first, by increasing distance.
    pub fn reached(&self) -> &[u32] {
        &self.order
    }

    /// A shortest route from the root to `node`, both included; `None` if there is no route.
    pub fn route(&self, node: usize) -> Option<Vec<usize>> {
        let length = self.distance(node)? + 1;
        let mut route = Vec::with_capacity(length);
        let mut at = node;
        route.push(at);
        while let Some(parent) = self.parent(at) {
            route.push(parent);
            at = parent;
        }
        route.reverse();
        Some(route)
    }
}

/// The connected components of a network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Components {
    /// Component of each node. Components are numbered in the order of their lowest node.
    pub labels: Vec<u32>,
    /// Number of nodes of each component. A connected network has one.
    pub sizes: Vec<usize>,
}

impl Graph {
    /// Breadth-first distances from `root`, and the routing tree.
    ///
    /// # Errors
    /// If `root` does not exist.
    pub fn hops_from(&self, root: usize) -> Result<Hops, ArgumentError> {
        self.check(root)?;
        let mut hops = self.unreached();
        self.flood(root, &mut hops);
        // Choose parents by index, so that they do not depend on the order of the search.
        for at in 0..hops.order.len() {
            let node = hops.order[at] as usize;
            let nearer = hops.distances[node].checked_sub(1);
            if let Some(parent) = self
                .neighbours(node)
                .iter()
                .find(|other| Some(hops.distances[**other as usize]) == nearer)
            {
                hops.parents[node] = *parent;
            }
        }
        Ok(hops)
    }

    fn unreached(&self) -> Hops {
        Hops {
            distances: vec![UNREACHED; self.len()],
            parents: vec![UNREACHED; self.len()],
            order: Vec::new(),
        }
    }

    /// Breadth-first search of the nodes that were not reached before; `order` is its queue.
    fn flood(&self, root: usize, hops: &mut Hops) {
        hops.distances[root] = 0;
        hops.order.push(root as u32);
        let mut at = hops.order.len() - 1;
        while let Some(&node) = hops.order.get(at) {
            let next = hops.distances[node as usize] + 1;
            for &other in self.neighbours(node as usize) {
                if hops.distances[other as usize] == UNREACHED {
                    hops.distances[other as usize] = next;
                    hops.order.push(other);
                }
            }
            at += 1;
        }
    }

    /// The connected components.
    pub fn components(&self) -> Components {
        let (mut labels, mut sizes) = (vec![0; self.len()], Vec::new());
        let mut hops = self.unreached();
        for root in 0..self.len() {
            if hops.distances[root] == UNREACHED {
                let before = hops.order.len();
                self.flood(root, &mut hops);
                let members = &hops.order[before..];
                members
                    .iter()
                    .for_each(|node| labels[*node as usize] = sizes.len() as u32);
                sizes.push(members.len());
            }
        }
        Components { labels, sizes }
    }

    /// The nodes other than `root` that satisfy `wanted` at the smallest number of hops, and that number. The way may lead through nodes
    /// that do not satisfy it. Empty if no reachable node does.
    ///
    /// # Errors
    /// If `root` does not exist.
    pub fn nearest(&self, root: usize, wanted: impl Fn(usize) -> bool) -> Result<(Vec<usize>, usize), ArgumentError> {
        self.check(root)?;
        let mut seen = vec![false; self.len()];
        seen[root] = true;
        let (mut ring, mut hops) = (vec![root], 0);
        while !ring.is_empty() {
            let mut next = Vec::new();
            for node in ring {
                for &other in self.neighbours(node) {
                    if !std::mem::replace(&mut seen[other as usize], true) {
                        next.push(other as usize);
                    }
                }
            }
            hops += 1;
            // In increasing order, so that the result does not depend on the order of the search.
            next.sort_unstable();
            let found: Vec<usize> = next.iter().copied().filter(|node| wanted(*node)).collect();
            if !found.is_empty() {
                return Ok((found, hops));
            }
            ring = next;
        }
        Ok((Vec::new(), 0))
    }
}
