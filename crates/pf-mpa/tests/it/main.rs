//! Integration tests: fixtures of another program, laws, bad input.

#![allow(clippy::unwrap_used, clippy::panic)]

mod allocation;
mod attacks;
mod fixtures;
mod grid;
mod laws;
mod odometry;
mod recording;
mod rooms;
mod strengths;
mod walks;
mod wild;
