//! Errors of a link.

use fewbits_protocol::BoxError;
use std::path::PathBuf;

/// Why a process of a link could not start or continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}")]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// A socket, a broker or a session failed.
    #[error("socket {address}")]
    Socket {
        /// Address of the socket, broker or session.
        address: String,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// A stored state was not written by this program or is incomplete.
    #[error("{path} is no state of this centre: {reason}")]
    State {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Another process uses the state, or another station or sensor of this one.
    #[error("{path} is in use by another process: end it, or give each its own state")]
    Locked {
        /// Path of the state.
        path: PathBuf,
    },
    /// Other users of the machine may read or change a file with keys or a state.
    #[error("{path}: others than its owner may read or change it (mode {mode:o}): run `chmod 600 {path}`")]
    Shared {
        /// Path of the file.
        path: PathBuf,
        /// Its rights.
        mode: u32,
    },
    /// An argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// The estimator failed before the first slot.
    #[error("the estimator")]
    Estimator(#[source] BoxError),
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&fewbits_numerics::ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }

    /// Whether a file could not be read or written, which may pass: a full disk, too many open files.
    pub(crate) fn is_of_file(&self) -> bool {
        matches!(self, Self::File { .. })
    }

    pub(crate) fn socket(address: impl ToString, source: std::io::Error) -> Self {
        let address = address.to_string();
        Self::Socket { address, source }
    }
}
