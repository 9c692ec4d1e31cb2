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
pub use iterations::{Figure42, Figure43, Figure44, Figure45};
pub use table4_1::Table41;
pub use table4_2::Table42;
pub use table4_3::Table43;
pub use table4_4::Table44;
pub use table4_5::{Mismatch, Table45};

use crate::AnyFigure;
use crate::legacy::Old;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &Old(Figure42),
        &Old(Figure43),
        &Table41,
        &Table42,
        &Table43,
        &Old(Table44),
        &Old(Table45),
        &Old(Mismatch),
        &Old(Figure44),
        &Old(Figure45),
        &Old(Beyond),
    ]
}
