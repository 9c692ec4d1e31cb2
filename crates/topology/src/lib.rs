//! Positions of sensors, graphs of nodes in range of each other, and routes.
//!
//! | question | answer |
//! |---|---|
//! | where do the sensors stand | [`Deployment`]: uniform, grid, given |
//! | who is in radio range of whom | [`Graph`], built in time and memory linear in nodes and edges |
//! | how far, in hops, and by which way | [`Hops`]: breadth-first distances and the routing tree they form |
//! | is the network in one piece | [`Graph::components`] |
//! | where next, when every neighbour was visited | [`Graph::nearest`] |
//!
//! The central choice is that a graph is two flat arrays (neighbours sorted by index, and where each node's begin), never a
//! list of lists: a million nodes fit in a few hundred megabytes, and equal positions give equal bits.
//!
//! ```
//! use fewbits_topology::{Deployment, Graph};
//! let field = Deployment::grid([0.0, 0.0], [40.0, 40.0], [5, 5])?;
//! let graph = Graph::within(field.positions(), 10.0)?;
//! let hops = graph.hops_from(0)?;
//! assert_eq!(hops.distance(24), Some(8));
//! assert_eq!(hops.route(24).map(|route| route.len()), Some(9));
//! assert!(graph.components().is_connected());
//! # Ok::<(), fewbits_numerics::ArgumentError>(())
//! ```
//!
//! Not here: time, energy and radio channels, which belong to the simulated network.

mod deployment;
mod graph;
mod search;

pub use deployment::Deployment;
pub use graph::Graph;
pub use search::{Components, Hops};
