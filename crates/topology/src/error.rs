//! Errors of deployments and graphs.

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A node index beyond the last node.
    #[error("node {node} does not exist: the network has {nodes} nodes")]
    NoSuchNode {
        /// Index of the node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
}
