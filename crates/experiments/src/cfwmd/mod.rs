//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

use crate::AnyFigure;

mod beyond;
mod blind;
mod case;
mod ensemble;
mod linear;
mod nonlinear;
mod scalar;
mod vector;

use case::Simulated;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        const { &Simulated::<scalar::Fig1>::new() },
        const { &Simulated::<scalar::Fig2>::new() },
        const { &Simulated::<blind::Fig3>::new() },
        const { &Simulated::<vector::Fig4>::new() },
        const { &Simulated::<vector::Fig5>::new() },
        const { &Simulated::<vector::Fig6>::new() },
        &nonlinear::figures::Fig7,
        const { &Simulated::<nonlinear::figures::Fig8>::new() },
        const { &Simulated::<nonlinear::figures::Fig9>::new() },
        const { &Simulated::<nonlinear::figures::Fig10>::new() },
        const { &Simulated::<scalar::Table1>::new() },
        const { &Simulated::<vector::Table2>::new() },
        const { &Simulated::<nonlinear::figures::Table3>::new() },
        const { &Simulated::<beyond::Lossy>::new() },
        const { &Simulated::<beyond::Scheduled>::new() },
        const { &Simulated::<beyond::Cost>::new() },
        const { &Simulated::<blind::NoFeedbackFigure>::new() },
    ]
}
