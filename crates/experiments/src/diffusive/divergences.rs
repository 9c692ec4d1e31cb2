//! The divergence of what travels from the exact belief.

use super::beliefs::{POSITION_ONLY, divergence, exact_search};
use super::common::{ALARM, LPG, Settings, median, quantile};
use super::two_phase::TwoPhase;
use crate::prelude::*;
use fewbits_core::{Gaussian, Likelihood};
use fewbits_diffusive::{Form, Outcome, Posterior, SourceLikelihood};
use nalgebra::Vector2;

/// `KL(exact || the paper's form)`, nats, and the share of its terms that the print gives no answer for.
fn two_phases(settings: &Settings, outcome: &Outcome, posterior: &Posterior) -> Result<(f64, f64), Error> {
    let alarm = Vector2::from(ALARM);
    let spread = nalgebra::Matrix2::identity() * settings.prior_sd.powi(2);
    let prior = Gaussian::new(alarm, spread).and_then(|g| g.factored())?;
    let likelihood = SourceLikelihood::new(outcome.records.clone(), settings.joint()?)?;
    let log_density = |x: &Vector2<f64>| prior.log_pdf(x) + likelihood.log_likelihood(x);
    let fit = TwoPhase::fit(posterior, &log_density, 2, 5)?;
    Ok((fit.divergence_from(&posterior.cells)?, fit.no_answer))
}

parameters! {
    /// Settings of the divergences.
    #[derive(Debug, Clone)]
    pub struct KlParameters {
        trials: u64 [1..=100_000] = 200 => quick 8 => "Random deployments.",
        nodes: Vec<usize> [1..=20; 1..] = vec![1, 2, 3, 4] => "Nodes that have sampled.",
    }
}

rows! {
    pub struct KlRow by "{nodes} {rep}" {
        nodes: usize => "Nodes that have sampled.",
        rep: &'static str => "What the belief is approximated by.",
        scalars: usize => "Numbers in a message.",
        kl_median: Measured ["nats"] => "Median `KL(exact || rep)`.",
        kl_q90: f64 ["nats"] => "Its upper decile.",
        kl_mean: f64 ["nats"] => "Its mean.",
        kl_max: f64 ["nats"] => "Its maximum.",
        /// Share of the terms for which the printed recipe has no answer: the curvature at the peak is not definite.
        no_answer: Option<f64>,
        trials: usize => "Deployments.",
    }
}

const FORMS: [(&str, Form); 8] = [
    ("gaussian", Form::Gaussian),
    ("gmm-2", Form::Mixture(2)),
    ("gmm-4", Form::Mixture(4)),
    ("gmm-8", Form::Mixture(8)),
    (
        "lpg-1x5",
        Form::Lpg {
            components: 1,
            degree: 5,
        },
    ),
    (
        "lpg-2x3",
        Form::Lpg {
            components: 2,
            degree: 3,
        },
    ),
    ("lpg-2x5", LPG),
    ("particles-25", Form::Particles(25)),
];

/// Polynomial Gaussians as printed: a plain density, fitted in two phases.
const TWO_PHASES: &str = "lpg-2x5 printed";

/// Divergence against the numbers sent.
pub struct Divergences;

impl Figure for Divergences {
    figure!(KlParameters => Vec<KlRow>, "diffusive-kl", "What a number buys", "",
        "Kullback-Leibler divergence of the exact belief (example B, rate integrated out) from what would travel, against \
         the numbers in a message, after one to four nodes.");

    fn cost(&self, p: &KlParameters) -> Cost {
        Cost::new(p.trials as f64 * p.nodes.len() as f64 * 0.1, 1e6)
    }

    fn run(&self, p: &KlParameters, context: &Context<'_>) -> Result<Vec<KlRow>, Error> {
        let settings = Settings::default();
        let all = context.trials("diffusive-chains", p.trials, |trial| {
            p.nodes
                .iter()
                .map(|nodes| {
                    let outcome = exact_search(&settings, trial, *nodes)?;
                    let Some(posterior) = &outcome.posterior else {
                        return Ok(None);
                    };
                    let kls = FORMS.iter().map(|(_, form)| divergence(posterior, *form));
                    let mut kls = kls.collect::<Result<Vec<_>, _>>()?;
                    let (printed, no_answer) = two_phases(&settings, &outcome, posterior)?;
                    kls.push(printed);
                    Ok(Some((kls, no_answer)))
                })
                .collect::<Result<Vec<_>, Error>>()
        })?;
        let mut rows = Vec::new();
        for (n, nodes) in p.nodes.iter().enumerate() {
            let printed = (TWO_PHASES, LPG);
            for (f, (rep, form)) in FORMS.iter().chain([&printed]).enumerate() {
                let found = || all.iter().filter_map(|trial| trial[n].as_ref());
                let kls: Vec<f64> = found().map(|(kls, _)| kls[f]).collect();
                let count = kls.len();
                let (Some(kl_median), Some(kl_q90)) = (median(&kls), quantile(kls.iter().copied(), 0.9)) else {
                    continue;
                };
                let no_answer = found().map(|(_, share)| share).sum::<f64>() / count as f64;
                rows.push(KlRow {
                    nodes: *nodes,
                    rep,
                    scalars: form.scalars(&POSITION_ONLY).unwrap_or(0),
                    kl_median,
                    kl_q90,
                    kl_mean: kls.iter().sum::<f64>() / count as f64,
                    kl_max: kls.iter().copied().fold(0.0, f64::max),
                    no_answer: (*rep == TWO_PHASES).then_some(no_answer),
                    trials: count,
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &KlParameters, rows: &Vec<KlRow>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        let find =
            |nodes: usize, rep: &str| first(rows, |r| r.nodes == nodes && r.rep == rep).map(|r| r.kl_median.value);
        full.keyed("kl_median", "median divergence", rows, |r| r.kl_median);
        let what = "no mean divergence is negative, but for what sums over cells leave (0.01 nats)";
        claims.all("positive", what, rows, |r| r.kl_mean >= -0.01);
        let what = "after the first ring eight Gaussians are closer than two polynomial Gaussians";
        let gap = minus(find(1, "gmm-8"), find(1, "lpg-2x5"));
        full.below("ring", what, gap, 0.0);
        for nodes in [2, 3] {
            let what = "polynomial Gaussians are far closer than one Gaussian";
            let ratio = over(find(nodes, "gaussian"), find(nodes, "lpg-2x5"));
            full.above(format!("lpg-beats-gaussian/{nodes}"), what, ratio, 5.0);
        }
        let row = |nodes, rep| rows.iter().find(|r: &&KlRow| (r.nodes, r.rep) == (nodes, rep));
        let mean = |nodes, rep| row(nodes, rep).map(|r| r.kl_mean);
        let ratio = over(mean(1, TWO_PHASES), mean(1, "lpg-2x5"));
        let what =
            "on the first ring the printed two-phase fit is on average at least twice as far away as the Galerkin form";
        full.at_least("printed-ring", what, ratio, 2.0);
        let what = "and of most terms there is no printed answer: no definite curvature (erratum diffusive-14)";
        let share = row(1, TWO_PHASES).and_then(|r| r.no_answer);
        full.at_least("printed-no-answer", what, share, 0.5);
        let ratio = over(mean(3, TWO_PHASES), find(3, TWO_PHASES));
        let what = "after three nodes the printed fit has a heavy tail: its mean divergence is ten medians or more";
        full.above("printed-tail", what, ratio, 10.0);
        let what = "more components bring a mixture closer";
        full.decreasing("more-is-closer", what, ["gaussian", "gmm-2", "gmm-4", "gmm-8"].map(|rep| find(3, rep)));
    }

    fn plot(&self, _: &KlParameters, rows: &Vec<KlRow>) -> Plot {
        let counts = || rows.iter().map(|r| r.nodes as f64);
        let (first, last) = (counts().fold(f64::INFINITY, f64::min), counts().fold(0.0, f64::max));
        let nodes = Axis::linear("nodes").between(first - 0.1, last + 0.1);
        let mut panel = Panel::new("Divergence per number", nodes, Axis::log("median KL (nats)"));
        let shown = FORMS.iter().map(|form| form.0).filter(|rep| *rep != "lpg-2x3");
        for (i, rep) in shown.chain([TWO_PHASES]).enumerate() {
            let of = || rows.iter().filter(|r| r.rep == rep);
            let scalars = of().next().map_or(0, |r| r.scalars);
            let marks = of().map(|r| (r.nodes as f64, r.kl_median)).collect();
            panel = panel.with_all(Layer::curve(format!("{rep} ({scalars})"), i, marks));
        }
        Plot::of(panel)
    }
}
