//! KL against components for every reduction.

use super::filters::{Truth, posteriors};
use crate::prelude::*;
use fewbits_densities::{KernelEstimate, Mixture};
use fewbits_mixture_codec::merge::{MergeCost, merge};
use fewbits_mixture_codec::tree::{At, Axis as SplitAxis};
use fewbits_mixture_codec::{Criterion, Reduction, Split};
use std::time::Instant;

parameters! {
    pub struct Parameters {
        components: Vec<usize> [1..=100; 1..] = vec![3, 5, 10, 20] => "Components.",
        trials: u64 [2..=10_000] = 10 => quick 2 => "Worlds, of three beliefs each.",
    }
}

rows! {
    pub struct Rows {
        errors: Vec<Row> => "Errors.",
        /// What the methods cost.
        cost: Vec<Time> ["time"],
    }

    struct Row by "{method}-m{components}" {
        method: &'static str => "Method.",
        components: usize => "The most components.",
        kl: Measured ["nat"] => "KL from the estimate to the mixture, by quadrature.",
    }

    struct Time {
        method: &'static str => "Method.",
        components: usize => "The most components.",
        milliseconds: f64 ["ms"] => "Time of one reduction, the mean of all.",
    }
}

/// The methods by name.
fn methods() -> Vec<(&'static str, Method)> {
    let split = |axis, at| Split { axis, at };
    let greedy = |split, criterion| Method::Plain(Reduction::Greedy { split, criterion });
    let (widest, count) = (SplitAxis::Widest, At::CountMedian);
    vec![
        ("kd ml", greedy(Split::KD, Criterion::Ml)),
        ("kd l1", greedy(Split::KD, Criterion::L1)),
        ("kd kl", greedy(Split::KD, Criterion::Kl)),
        (
            "kd kl optimal",
            Method::Plain(Reduction::Optimal {
                split: Split::KD,
                criterion: Criterion::Kl,
            }),
        ),
        ("kd closed form", greedy(split(widest, count), Criterion::LogDeterminant)),
        ("principal kl", greedy(Split::PRINCIPAL, Criterion::Kl)),
        ("principal closed form", greedy(Split::PRINCIPAL, Criterion::LogDeterminant)),
        ("alternating kl", greedy(split(SplitAxis::Alternating, count), Criterion::Kl)),
        (
            "runnalls",
            Method::Plain(Reduction::Merging {
                cost: MergeCost::Runnalls,
            }),
        ),
        (
            "salmond",
            Method::Plain(Reduction::Merging {
                cost: MergeCost::Salmond,
            }),
        ),
        ("williams from 30", Method::Williams),
        ("pipeline 0", Method::Plain(Reduction::Pipeline { cut: 60, iterations: 0 })),
        ("pipeline 15", Method::Plain(Reduction::default())),
        (
            "pipeline 40",
            Method::Plain(Reduction::Pipeline {
                cut: 60,
                iterations: 40,
            }),
        ),
    ]
}

enum Method {
    Plain(Reduction),
    Williams,
}

impl Method {
    fn reduce(&self, estimate: &KernelEstimate<2>, components: usize) -> Result<Mixture<2>, Error> {
        Ok(match self {
            Self::Plain(reduction) => reduction.reduce(estimate, components)?,
            Self::Williams => {
                let coarse = Reduction::Merging {
                    cost: MergeCost::Runnalls,
                }
                .reduce(estimate, 30.max(components))?;
                merge(&coarse, components, MergeCost::Williams)?.mixture
            }
        })
    }
}

/// The comparison of reductions.
pub struct Reductions;

impl Rows {
    fn kl(&self, method: &str, components: usize) -> Option<f64> {
        first(&self.errors, |r| r.method == method && r.components == components).map(|r| r.kl.value)
    }
}

impl Figure for Reductions {
    figure!(Parameters => Rows, "handoff-reduction", "What a reduction loses", "our own comparison",
        "KL from the kernel estimate to the reduced mixture, by quadrature, over beliefs of uncompressed filters at times \
         2, 5 and 8. The recommended pipeline loses less than half of what the paper's cut does.");

    fn measures_time(&self) -> bool {
        true
    }

    fn cost(&self, p: &Parameters) -> Cost {
        Cost::new(2.0 * p.trials as f64, 1e6 * p.trials as f64)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let methods = methods();
        let one = |it: Trial| -> Result<Vec<(f64, f64)>, Error> {
            let mut all = vec![(0.0, 0.0); methods.len() * p.components.len()];
            let estimates = posteriors(it.stream, &[2, 5, 8])?;
            for estimate in &estimates {
                let truth = Truth::new(estimate);
                for (m, (_, method)) in methods.iter().enumerate() {
                    for (c, components) in p.components.iter().enumerate() {
                        let start = Instant::now();
                        let mixture = method.reduce(estimate, *components)?;
                        let time = start.elapsed().as_secs_f64() * 1e3;
                        let cell = &mut all[m * p.components.len() + c];
                        cell.0 += truth.kl(&mixture) / estimates.len() as f64;
                        cell.1 += time / estimates.len() as f64;
                    }
                }
            }
            Ok(all)
        };
        let runs = context.trials("handoff-reduction", p.trials, one)?;
        let (mut errors, mut cost) = (Vec::new(), Vec::new());
        for (m, (method, _)) in methods.iter().enumerate() {
            for (c, components) in p.components.iter().enumerate() {
                let at = m * p.components.len() + c;
                let kl = runs.iter().map(|run| run[at].0).collect();
                let milliseconds = runs.iter().map(|run| run[at].1).collect::<Moments>().mean();
                errors.push(Row {
                    method,
                    components: *components,
                    kl,
                });
                cost.push(Time {
                    method,
                    components: *components,
                    milliseconds,
                });
            }
        }
        Ok(Rows { errors, cost })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let (full, paper) = (claims.at_full_trials(), claims.at_defaults().at_full_trials());
        full.keyed("kl", "KL", &rows.errors, |r| r.kl);
        for m in p.components.iter().filter(|m| **m >= 3) {
            let ratio = over(rows.kl("pipeline 15", *m), rows.kl("kd kl", *m));
            let what = "the recommended pipeline loses at most 0.65 of what the paper's cut does";
            paper.at_most(format!("pipeline-m{m}"), what, ratio, 0.65);
            let gap = minus(rows.kl("kd kl", *m), rows.kl("kd ml", *m));
            paper.below(format!("ml-worst-m{m}"), "cuts by ML lose more than cuts by KL", gap, 0.0);
            let gap = minus(rows.kl("principal kl", *m), rows.kl("alternating kl", *m));
            // With three components the difference is below its standard error.
            if *m >= 5 {
                paper.below(format!("alternating-m{m}"), "alternating axes lose more than principal axes", gap, 0.0);
            }
        }
        let more = p.components.iter().map(|m| rows.kl("pipeline 15", *m));
        paper.decreasing("more", "more components lose less", more);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let layers = methods().into_iter().enumerate().map(|(i, (method, _))| {
            let of = rows.errors.iter().filter(|r| r.method == method);
            Layer::measured(super::title(method), of, |r| (r.components as f64, r.kl)).coloured(i)
        });
        let panel = Panel::loglog("KL of the reduced mixture", "components M", "KL / nat").with_all(layers);
        Plot::of(panel)
    }
}
