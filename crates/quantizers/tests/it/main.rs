//! Integration tests: the public interface against values computed by independent programs.
#![allow(clippy::unwrap_used, clippy::panic)]

mod assignment;
mod binary;
mod bounds;
