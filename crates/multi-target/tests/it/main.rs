//! Association and metric against enumeration, closed forms and the printed special case.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod association;
mod metric;
mod tracker;
