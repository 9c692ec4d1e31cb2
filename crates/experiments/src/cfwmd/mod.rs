//! CFwMD, censoring sensors and the fusion of silence: figures and tables.

use crate::AnyFigure;
use crate::legacy::Old;

mod beyond;
mod case;
mod ensemble;
mod linear;
mod no_feedback;
mod nonlinear;
mod scalar;
mod vector;

use case::Simulated;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        const { &Old(Simulated::<scalar::Fig1>::new()) },
        const { &Old(Simulated::<scalar::Fig2>::new()) },
        const { &Old(Simulated::<no_feedback::Fig3>::new()) },
        const { &Old(Simulated::<vector::Fig4>::new()) },
        const { &Old(Simulated::<vector::Fig5>::new()) },
        const { &Old(Simulated::<vector::Fig6>::new()) },
        &Old(nonlinear::figures::Fig7),
        const { &Old(Simulated::<nonlinear::figures::Fig8>::new()) },
        const { &Old(Simulated::<nonlinear::figures::Fig9>::new()) },
        const { &Old(Simulated::<nonlinear::figures::Fig10>::new()) },
        const { &Old(Simulated::<scalar::Table1>::new()) },
        const { &Old(Simulated::<vector::Table2>::new()) },
        const { &Old(Simulated::<nonlinear::figures::Table3>::new()) },
        const { &Old(Simulated::<beyond::Lossy>::new()) },
        const { &Old(Simulated::<beyond::Scheduled>::new()) },
        const { &Old(Simulated::<beyond::Cost>::new()) },
        const { &Old(Simulated::<no_feedback::NoFeedbackFigure>::new()) },
    ]
}
