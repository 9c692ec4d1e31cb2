//! Tests of the public interface.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod allocation;
mod bank;
#[path = "../../../block-codec/tests/it/common.rs"]
mod common;
mod damage;
mod guarantee;
mod loss;
mod recording;
mod replicas;
mod tuning;
mod wild;
