//! Comparisons against exact discrete chains.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod chains;
