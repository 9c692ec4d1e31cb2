//! Positions of sensors, graphs of nodes in range of each other, and routes.
//!
//! | question | answer |
//! |---|---|
//! | where the sensors are | [`Deployment`]: uniform, grid, given |
//! | which nodes are in radio range of each other | [`Graph`], built in time and memory linear in nodes and edges |
//! | distances in hops, and routes | [`Hops`]: breadth-first distances and their routing tree |
//! | whether the network is connected | [`Graph::components`] |
//! | the nearest unvisited node, when every neighbour was visited | [`Graph::nearest`] |
//!
//! A graph is stored in two flat arrays: the neighbours of all nodes, and where those of each node begin. A million nodes
//! fit in a few hundred megabytes, and equal positions give bitwise equal graphs.
//!
//! ```
//! use fewbits_topology::{Deployment, Graph};
//! let field = Deployment::grid([0.0, 0.0], [40.0, 40.0], [5, 5])?;
//! let graph = Graph::within(field.positions(), 10.0)?;
//! let hops = graph.hops_from(0)?;
//! assert_eq!(hops.distance(24), Some(8));
//! assert_eq!(hops.route(24).map(|route| route.len()), Some(9));
//! assert_eq!(graph.components().sizes, [25]);
//! # Ok::<(), fewbits_numerics::ArgumentError>(())
//! ```
//!
//! Not here: time, energy and radio channels (`fewbits-network`).

mod deployment;
mod graph;
mod search;

pub use deployment::Deployment;
pub use graph::Graph;
pub use search::{Components, Hops};
