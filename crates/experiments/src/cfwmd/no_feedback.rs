//! No feedback, scalar measurements: figure 3 and what silence is worth.

use super::case::Simulated;
use super::linear::{Method, Scheme};
use super::pictures::BOTH;
use super::rows::{Part, Step};
use super::setting::{Linear, Setting};
use crate::prelude::*;

/// The schemes of the publication where nothing is fed back.
pub(super) const FOUR_ALONE: [(&str, Scheme); 4] = [
    ("all", Scheme::All),
    ("CFwMD", Scheme::NoFeedback(Method::Joint)),
    ("CFoMD", Scheme::NoFeedback(Method::Ignored)),
    ("random", Scheme::Random),
];

pub(crate) static FIG3: Simulated<Linear, Step> = Simulated {
    about: About::of("cfwmd-fig3", "Scalar measurements, no feedback", "CFwMD paper, figure 3"),
    caption: "The order of the published figure, obtained with the correct filter: a joint Gaussian belief over the \
              state and the sensors' own estimates. With the printed likelihood CFwMD would coincide with CFoMD.",
    pairs: &[("CFwMD", "CFoMD"), ("CFoMD", "random")],
    setting: || Linear::scalar(2, &[1.0]),
    simulate: |setting, context| setting.at_budgets(context, "", &FOUR_ALONE),
    claims: |rows, claims| {
        rows.in_order(claims, &["all", "CFwMD", "CFoMD", "random"], ("", 1.0), &BOTH);
        rows.beat(claims, &[("CFwMD", "CFoMD")], ("", 1.0), &BOTH);
        rows.beat(claims, &[("CFoMD", "random")], ("", 1.0), &[Part::Position]);
        let rate = rows.at("CFwMD", 1.0).map(|r| r.rate);
        claims.within("rate-exact", "without feedback the rate is exactly the budget", rate, 1.0, 4.0);
        let gain = rows.ratio("CFwMD", "CFoMD", 1.0).map(|r| 1.0 - r);
        claims.near("gain", "using silence lowers the position RMSE by a tenth", gain, 0.105, 0.025);
    },
    ..Simulated::BASE
};

pub(crate) static NO_FEEDBACK: Simulated<Linear, Step> = Simulated {
    about: About::of("cfwmd-nofeedback", "What silence is worth without feedback", ""),
    caption: "Exact filter (measurements imputed), joint Gaussian belief, a heuristic that scatters the sensors' \
              estimates about the fusion centre's, the filter that ignores silence, and the paper's law of the \
              sensors' estimates with its mean corrected, which does harm because it forgets the data. The likelihood \
              as printed is one number whatever the state, and so leaves the filter that ignores silence.",
    pairs: &[
        ("exact", "joint Gaussian"),
        ("joint Gaussian", "ignored"),
        ("exact", "ignored"),
        ("heuristic", "ignored"),
        ("ignored", "no history"),
        ("joint Gaussian", "heuristic"),
    ],
    setting: || Linear {
        trials: 4000,
        ..Linear::scalar(2, &[1.0]).with_particles(500)
    },
    simulate: |setting, context| {
        let schemes = [
            ("exact", Scheme::NoFeedback(Method::Imputed(setting.cloud()))),
            ("joint Gaussian", Scheme::NoFeedback(Method::Joint)),
            ("heuristic", Scheme::NoFeedback(Method::Centred)),
            ("ignored", Scheme::NoFeedback(Method::Ignored)),
            ("no history", Scheme::NoFeedback(Method::Unconditional)),
        ];
        setting.at_budgets(context, "", &schemes)
    },
    claims: |rows, claims| {
        let pairs = [
            ("exact", "ignored"),
            ("joint Gaussian", "ignored"),
            ("heuristic", "ignored"),
        ];
        rows.beat(claims, &pairs, ("", 1.0), &[Part::Position]);
        rows.beat(claims, &[("joint Gaussian", "heuristic")], ("", 1.0), &[Part::Position]);
        rows.beat(&claims.showing("cfwmd-3"), &[("ignored", "no history")], ("", 1.0), &[Part::Position]);
        let gap = rows
            .pair(("exact", "joint Gaussian"), "", 1.0)
            .map(|p| p.position.value);
        let what = "the joint Gaussian belief is as good as the exact filter (difference in squared error, m^2; erratum cfwmd-4)";
        claims.near("joint-is-exact", what, gap, 0.0, 0.01);
    },
    ..Simulated::BASE
};
