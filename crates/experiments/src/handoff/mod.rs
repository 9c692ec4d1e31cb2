//! A belief that travels from leader to leader in a few bytes: figures.

mod fig2;
mod fig3;
mod fig4;
mod fig5;
mod fig6;
mod fig6c;
pub mod filters;
mod rate;
mod reduction;
pub mod world;

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &fig2::Fig2,
        &fig3::Fig3,
        &fig4::Fig4,
        &fig5::Fig5,
        &fig6::FIG6A,
        &fig6::FIG6B,
        &fig6c::Fig6c,
        &reduction::Reductions,
        &rate::Rate,
    ]
}
