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

use case::Simulated;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &Simulated::<scalar::Fig1>::NEW,
        &Simulated::<scalar::Fig2>::NEW,
        &Simulated::<no_feedback::Fig3>::NEW,
        &Simulated::<vector::Fig4>::NEW,
        &Simulated::<vector::Fig5>::NEW,
        &Simulated::<vector::Fig6>::NEW,
        &field::Fig7,
        &Simulated::<field::Fig8>::NEW,
        &Simulated::<field::Fig9>::NEW,
        &Simulated::<field::Fig10>::NEW,
        &Simulated::<scalar::Table1>::NEW,
        &Simulated::<vector::Table2>::NEW,
        &Simulated::<field::Table3>::NEW,
        &Simulated::<beyond::Lossy>::NEW,
        &Simulated::<beyond::Scheduled>::NEW,
        &Simulated::<beyond::Cost>::NEW,
        &Simulated::<no_feedback::NoFeedbackFigure>::NEW,
    ]
}
