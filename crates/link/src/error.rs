//! What can go wrong with a link.

use fewbits_protocol::BoxError;
use std::path::PathBuf;

/// Why a process of a link could not start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A socket, a broker or a session failed.
    #[error("socket {address}")]
    Socket {
        /// Its address.
        address: String,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A stored state is none of this program, or not whole.
    #[error("{path} is no state of this centre: {reason}")]
    State {
        /// The file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// An argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// The estimator failed before the first slot.
    #[error("the estimator")]
    Estimator(#[source] BoxError),
}

impl Error {
    pub(crate) fn socket(address: impl ToString, source: std::io::Error) -> Self {
        let address = address.to_string();
        Self::Socket { address, source }
    }
}
