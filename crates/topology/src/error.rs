//! Errors of this crate.

/// Errors of deployments and graphs.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// A node index beyond the last node.
    #[error("node {node} does not exist: the network has {nodes} nodes")]
    NoSuchNode {
        /// The index.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
}
