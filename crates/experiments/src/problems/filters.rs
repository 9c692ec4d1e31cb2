//! `problems-filters`: which filter for which curve.

use super::settings::errors;
use crate::prelude::*;

/// The problems, in the order of the rows.
const PROBLEMS: [&str; 12] = [
    "moving observer",
    "two bearings",
    "range and bearing",
    "turn, two bearings",
    "turn, range and bearing",
    "turn, three ranges",
    "pendulum",
    "two wells",
    "limit cycle",
    "Lorenz",
    "re-entry",
    "growth",
];

parameters! {
    pub struct Parameters {
        trials: u64 [2..=10_000] = 60 => quick 4 => "Runs of each problem.",
    }
    cost |p| Cost::new(0.3 * p.trials as f64, 1e8);
}

rows! {
    pub struct Row by "{problem}" {
        problem: &'static str as x("problem") => "The problem.",
        /// Root mean squared error of the scored coordinates, in their unit, over the steps of all runs.
        assumed_density: Measured => "Linearised at the mean.",
        unscented: Measured => "Sigma points; the cubature rule from three coordinates on.",
        ensemble: Measured => "100 members.",
        grid: Measured => "The observed coordinates on a grid, the others by regression.",
        particles: Measured => "2000 particles.",
        reference: Option<f64> => "A particle filter of 20000 in another program.",
        assumed_density_ratio: Option<f64> as points("assumed density") => "Error over that of the reference.",
        unscented_ratio: Option<f64> as points("unscented") => "Error over that of the reference.",
        ensemble_ratio: Option<f64> as points("ensemble of 100") => "Error over that of the reference.",
        grid_ratio: Option<f64> as points("grid") => "Error over that of the reference.",
        particles_ratio: Option<f64> as points("2000 particles") => "Error over that of the reference.",
    }
}

pub struct Filters;

impl Figure for Filters {
    figure!(Parameters => Vec<Row>, "problems-filters", "Which filter for which curve", "our own comparison",
        "Twelve problems whose dynamics or sensors are not linear. Every sensor sends two bits about the receiver's own prediction: \
         four cells whose middle edges are 1.5 deviations of the noise apart. Errors over those of an independent particle filter of \
         20000 particles."; semilog("error over the reference"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let row = |problem: &'static str| {
            let stream = context.stream("problems-filters").named(problem);
            let found = context.moments(stream, p.trials, |trial| errors(problem, trial.stream))?;
            let of = |i: usize| Measured::root_mean(&found[i]);
            let reference = reference::value(&format!("problems-filters/particles/{problem}"));
            let ratio = |i: usize| reference.map(|reference| of(i).value / reference);
            Ok(Row {
                problem,
                assumed_density: of(0),
                unscented: of(1),
                ensemble: of(2),
                grid: of(3),
                particles: of(4),
                reference,
                assumed_density_ratio: ratio(0),
                unscented_ratio: ratio(1),
                ensemble_ratio: ratio(2),
                grid_ratio: ratio(3),
                particles_ratio: ratio(4),
            })
        };
        PROBLEMS.into_iter().map(row).collect()
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_defaults().at_full_trials();
        let all = |r: &Row| [r.assumed_density, r.unscented, r.ensemble, r.grid, r.particles];
        claims.all("finite", "every filter ends every run", rows, |r| {
            all(r).iter().all(|error| error.value.is_finite())
        });
        let mild = || select(rows, |r| r.problem != "growth");
        for (name, of) in [
            ("assumed-density", (|r| r.assumed_density_ratio) as fn(&Row) -> Option<f64>),
            ("unscented", |r| r.unscented_ratio),
            ("ensemble", |r| r.ensemble_ratio),
            ("grid", |r| r.grid_ratio),
        ] {
            let what = "beside the growth model, the error is at most 1.15 of the reference in every problem";
            full.all(format!("mild-{name}"), what, mild(), |r| of(r).is_some_and(|ratio| ratio <= 1.15));
        }
        let growth = |of: fn(&Row) -> Option<f64>| first(rows, |r| r.problem == "growth").and_then(of);
        full.at_least(
            "growth",
            "the growth model is no problem for a linearisation",
            growth(|r| r.assumed_density_ratio),
            2.0,
        );
        full.at_most("growth-ensemble", "an ensemble follows it", growth(|r| r.ensemble_ratio), 1.2);
        full.at_most("growth-particles", "and particles do best", growth(|r| r.particles_ratio), 1.05);
    }
}
