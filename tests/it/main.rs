//! Tests that cross crates.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

mod messages;
mod patterns;
mod quantizers;
mod receivers;
mod references;
