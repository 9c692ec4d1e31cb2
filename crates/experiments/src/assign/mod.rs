//! Bit-to-sensor assignment: figures and tables.

mod networks;
mod shapes;
mod table6_1;

use crate::AnyFigure;
use crate::legacy::Old;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &Old(shapes::Landings),
        &Old(table6_1::Table),
        &Old(networks::Spread),
        &Old(networks::Mean),
        &Old(shapes::BitErrors),
    ]
}
