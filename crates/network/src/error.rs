//! Errors of this crate.

use fewbits_core::CodecError;

fewbits_numerics::errors! {
    /// What the simulated network refuses.
    pub enum Error {
        /// A node that does not exist.
        #[error("node {node} does not exist: the network has {nodes} nodes")]
        UnknownNode {
            /// Its index.
            node: usize,
            /// Number of nodes.
            nodes: usize,
        },
        /// A node that sends to itself.
        #[error("node {node} sends to itself: expected another node")]
        SelfLink {
            /// Its index.
            node: usize,
        },
        /// Two nodes that are not in range of each other.
        #[error("node {to} is out of range of node {from}")]
        OutOfRange {
            /// The sender.
            from: usize,
            /// The receiver.
            to: usize,
        },
        /// A network that a protocol needs in one piece.
        #[error("the network is disconnected: {reached} of {nodes} nodes are reached from node {root}")]
        Disconnected {
            /// Where the search began.
            root: usize,
            /// Nodes that it reached.
            reached: usize,
            /// Number of nodes.
            nodes: usize,
        },
        /// A message that does not fit its format.
        #[error("message does not fit its format: {0}")]
        Codec(#[from] CodecError),
        /// An estimator or scheme failed.
        #[error("estimator: {0}")]
        Estimator(String),
        /// What was observed has probability zero under the belief.
        #[error("the observation is impossible under the belief")]
        Impossible,
        /// A stored log or snapshot that cannot be read or written.
        #[error("stored run: {0}")]
        Stored(String),
        /// A replayed run that left its log.
        #[error("the run left its log at transmission {transmission}: {difference}")]
        LeftLog {
            /// Number of the transmission.
            transmission: usize,
            /// What differs.
            difference: &'static str,
        },
    }
}

impl From<fewbits_topology::Error> for Error {
    fn from(error: fewbits_topology::Error) -> Self {
        match error {
            fewbits_topology::Error::NoSuchNode { node, nodes } => Self::UnknownNode { node, nodes },
            fewbits_topology::Error::Argument(error) => Self::Argument(error),
            other => Self::Estimator(other.to_string()),
        }
    }
}

impl From<fewbits_core::Error> for Error {
    fn from(error: fewbits_core::Error) -> Self {
        match error {
            fewbits_core::Error::Impossible => Self::Impossible,
            fewbits_core::Error::Argument(error) => Self::Argument(error),
            other => Self::Estimator(other.to_string()),
        }
    }
}

impl From<fewbits_filters::Error> for Error {
    fn from(error: fewbits_filters::Error) -> Self {
        match error {
            fewbits_filters::Error::Core(error) => error.into(),
            fewbits_filters::Error::Argument(error) => Self::Argument(error),
            other => Self::Estimator(other.to_string()),
        }
    }
}
