//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

use crate::AnyFigure;

mod case;
mod ensemble;
mod linear;
mod scalar;

use case::Simulated;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        const { &Simulated::<scalar::Fig1>::new() },
        const { &Simulated::<scalar::Fig2>::new() },
        const { &Simulated::<scalar::Table1>::new() },
    ]
}
