//! A belief that travels from leader to leader in a few bytes: figures.

mod bandwidth;
mod exact;
mod fig2;
mod fig3;
mod fig4;
mod fig5;
mod fig6;
mod fig6c;
mod filters;
mod rate;
mod reduction;
mod world;

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
        &bandwidth::Widths,
    ]
}

/// The words for a method in pictures.
fn title(method: &str) -> &str {
    match method {
        "ml" | "kd ml" => "KD-tree, ML",
        "l1" | "kd l1" => "KD-tree, L1",
        "kl" | "kd kl" => "KD-tree, KL",
        "kd kl optimal" => "KD-tree, KL, optimal",
        "closed" | "kd closed form" => "KD-tree, closed form",
        "principal kl" => "principal axes, KL",
        "principal closed form" => "principal axes, closed form",
        "alternating kl" => "alternating axes, KL",
        "runnalls" => "Runnalls",
        "salmond" => "Salmond",
        "williams from 30" => "Williams from 30",
        "pipeline 0" => "cut, Runnalls",
        "pipeline" | "pipeline 15" => "cut, Runnalls, 15 EM",
        "pipeline 40" => "cut, Runnalls, 40 EM",
        "gauss" => "one Gaussian",
        "kde" => "all kernels",
        "plain-500" => "500 particles",
        "plain-2000" => "2000 particles",
        other => other,
    }
}
