//! The engine, streams and statistics.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod engine;
mod random;
#[cfg(feature = "mpi")]
mod ranks;
mod wild;
