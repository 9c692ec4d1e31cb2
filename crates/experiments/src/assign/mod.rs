//! Bit-to-sensor assignment: figures and tables.

mod networks;
mod shapes;
mod table6_1;

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &shapes::Landings,
        &table6_1::Table,
        &networks::SPREAD,
        &networks::MEAN,
        &shapes::BitErrors,
    ]
}
