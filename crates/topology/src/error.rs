//! Errors of this crate.

use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What a deployment or graph refuses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A node index beyond the last node.
    #[error("node {node} does not exist: the network has {nodes} nodes")]
    NoSuchNode {
        /// The index.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
}
