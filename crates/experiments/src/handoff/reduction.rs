//! KL against components for every reduction.

use super::filters::{TIMES, Truth, over_beliefs};
use crate::prelude::*;
use fewbits_densities::{KernelEstimate, Mixture};
use fewbits_mixture_codec::merge::{MergeCost, merge};
use fewbits_mixture_codec::tree::{At, Axis as SplitAxis};
use fewbits_mixture_codec::{Criterion, Reduction, Split};

parameters! {
    pub struct Parameters {
        components: Vec<usize> [1..=100; 1..] = vec![3, 5, 10, 20] => "Components.",
        trials: u64 [2..=10_000] = 10 => quick 2 => "Worlds, of three beliefs each.",
    }
    cost |p| Cost::new(2.0 * p.trials as f64, 1e6 * p.trials as f64);
}

rows! {
    pub struct Row by "{method}-m{components}" at full_trials {
        method: &'static str as key => "Method.",
        components: usize as x("components M") => "The most components.",
        kl: Measured ["nat"] as points => "KL from the estimate to the mixture, by quadrature.",
    }
}

/// The methods by their names.
fn methods() -> [(&'static str, Method); 14] {
    use Criterion::{Kl, L1, LogDeterminant, Ml};
    use Method::{Plain, Williams};
    let greedy = |split, criterion| Plain(Reduction::Greedy { split, criterion });
    let optimal = |split, criterion| Plain(Reduction::Optimal { split, criterion });
    let merging = |cost| Plain(Reduction::Merging { cost });
    let pipeline = |iterations| Plain(Reduction::Pipeline { cut: 60, iterations });
    let at = At::CountMedian;
    let [widest, alternating] = [SplitAxis::Widest, SplitAxis::Alternating].map(|axis| Split { axis, at });
    [
        ("kd ml", greedy(Split::KD, Ml)),
        ("kd l1", greedy(Split::KD, L1)),
        ("kd kl", greedy(Split::KD, Kl)),
        ("kd kl optimal", optimal(Split::KD, Kl)),
        ("kd closed form", greedy(widest, LogDeterminant)),
        ("principal kl", greedy(Split::PRINCIPAL, Kl)),
        ("principal closed form", greedy(Split::PRINCIPAL, LogDeterminant)),
        ("alternating kl", greedy(alternating, Kl)),
        ("runnalls", merging(MergeCost::Runnalls)),
        ("salmond", merging(MergeCost::Salmond)),
        ("williams from 30", Williams),
        ("pipeline 0", pipeline(0)),
        ("pipeline 15", pipeline(15)),
        ("pipeline 40", pipeline(40)),
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
                let cost = MergeCost::Runnalls;
                let coarse = Reduction::Merging { cost }.reduce(estimate, 30.max(components))?;
                merge(&coarse, components, MergeCost::Williams)?.mixture
            }
        })
    }
}

pub struct Reductions;

impl Figure for Reductions {
    figure!(Parameters => Vec<Row>, "handoff-reduction", "What a reduction loses", "our own comparison",
        "KL from the kernel estimate to the reduced mixture, by quadrature, over beliefs of uncompressed filters at times \
         2, 5 and 8. The recommended pipeline loses less than half of what the paper's cut does."; loglog("KL / nat"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let methods = methods();
        let all = over_beliefs(context, "handoff-reduction", p.trials, |estimate, _| {
            let truth = Truth::new(estimate);
            let cell = |((name, method), m): (&(&'static str, Method), &usize)| {
                let kl = truth.kl(&method.reduce(estimate, *m)?);
                Ok(((*name, *m), [kl / TIMES.len() as f64]))
            };
            product(&methods, &p.components).into_iter().map(cell).collect()
        })?;
        let row = |((method, components), [kl]): (_, [Measured; 1])| Row { method, components, kl };
        Ok(all.into_iter().map(row).collect())
    }

    fn claims(&self, p: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let paper = claims.at_defaults().at_full_trials();
        let kl = |method: &str, m: usize| find(rows, &format!("{method}-m{m}")).map(|r| r.kl.value);
        for m in p.components.iter().copied().filter(|m| *m >= 3) {
            let ratio = over(kl("pipeline 15", m), kl("kd kl", m));
            let what = "the recommended pipeline loses at most 0.65 of what the paper's cut does";
            paper.at_most(format!("pipeline-m{m}"), what, ratio, 0.65);
            let gap = minus(kl("kd kl", m), kl("kd ml", m));
            paper.below(format!("ml-worst-m{m}"), "cuts by ML lose more than cuts by KL", gap, 0.0);
            let gap = minus(kl("principal kl", m), kl("alternating kl", m));
            // With three components the difference is below its standard error.
            if m >= 5 {
                paper.below(format!("alternating-m{m}"), "alternating axes lose more than principal axes", gap, 0.0);
            }
        }
        paper.decreasing("more", "more components lose less", p.components.iter().map(|m| kl("pipeline 15", *m)));
    }
}
