//! Errors of this crate.

fewbits_numerics::errors! {
    /// Errors of deployments and graphs.
    pub enum Error {
        /// A node index beyond the last node.
        #[error("node {node} does not exist: the network has {nodes} nodes")]
        NoSuchNode {
            /// The index.
            node: usize,
            /// Number of nodes.
            nodes: usize,
        },
    }
}
