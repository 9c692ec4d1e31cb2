//! Tests of the core against independent values, closed forms and laws.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod belief;
mod codec;
mod factor;
mod laws;
mod moments;
mod weighing;
mod wild;
