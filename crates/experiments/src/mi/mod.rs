//! Distributed quantizers by mutual information: figures and tables.

mod beyond;
mod common;
mod iterations;
mod plots;
mod table4_1;
mod table4_2;
mod table4_3;
mod table4_4;
mod table4_5;

pub use beyond::Beyond;
pub use iterations::{FIGURE42, FIGURE43, FIGURE44, FIGURE45};
pub use table4_1::Table41;
pub use table4_2::Table42;
pub use table4_3::Table43;
pub use table4_4::Table44;
pub use table4_5::{Mismatch, Table45};

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &FIGURE42, &FIGURE43, &Table41, &Table42, &Table43, &Table44, &Table45, &Mismatch, &FIGURE44, &FIGURE45,
        &Beyond,
    ]
}
