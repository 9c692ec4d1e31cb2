//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![]
}
