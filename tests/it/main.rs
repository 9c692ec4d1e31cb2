//! Tests that cross crates.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod messages;
mod paths;
mod patterns;
mod quantizers;
mod receivers;
mod references;
