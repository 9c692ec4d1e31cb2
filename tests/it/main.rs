//! Tests that cross crates.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod messages;
mod patterns;
mod quantizers;
mod receivers;
mod references;
