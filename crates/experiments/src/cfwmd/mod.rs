//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

use crate::AnyFigure;

mod beyond;
mod case;
mod field;
mod linear;
mod no_feedback;
mod nonlinear;
mod pictures;
mod rates;
mod rows;
mod scalar;
mod setting;
mod vector;
mod world;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &scalar::FIG1,
        &scalar::FIG2,
        &no_feedback::FIG3,
        &vector::FIG4,
        &vector::FIG5,
        &vector::FIG6,
        &field::Fig7,
        &field::FIG8,
        &field::FIG9,
        &field::FIG10,
        &scalar::TABLE1,
        &vector::TABLE2,
        &field::TABLE3,
        &beyond::LOSSY,
        &beyond::SCHEDULED,
        &no_feedback::NO_FEEDBACK,
    ]
}
