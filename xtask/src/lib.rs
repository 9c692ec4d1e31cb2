//! The project's command lines, one file a task.
//!
//! | task | what it does |
//! |---|---|
//! | [`figures`] | runs experiments, writes CSV, JSON, SVG and the gallery, fails where a claim fails |
//! | [`mod@bench`] | runs the benchmarks and prints each as a multiple of its group's unit |
//! | [`alone`] | builds every crate as a user would depend on it |
//! | [`api`] | lists the public items of every crate, or compares them with the list that is kept |
//! | [`size`] | counts lines and public items of every crate |
//! | [`tidy`] | checks the house rules: docs, lints, floors, panics, figure ids |
//!
//! No mathematics here: an experiment computes, this crate writes and draws.

pub mod alone;
pub mod api;
pub mod bench;
mod errata;
mod error;
pub mod figures;
mod files;
pub mod size;
pub mod tidy;

pub use error::Error;
