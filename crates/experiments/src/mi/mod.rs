//! Distributed quantizers by mutual information: figures and tables.

mod common;
mod iterations;
mod table4_1;
mod table4_2;
mod table4_3;
mod table4_4;
mod table4_5;

use crate::AnyFigure;
use iterations::{FIGURE42, FIGURE43, FIGURE44, FIGURE45};
use table4_5::{Mismatch, Table45};

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &FIGURE42,
        &FIGURE43,
        &table4_1::Table41,
        &table4_2::Table42,
        &table4_3::Table43,
        &table4_4::Table44,
        &Table45,
        &Mismatch,
        &FIGURE44,
        &FIGURE45,
    ]
}
