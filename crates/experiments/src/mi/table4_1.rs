//! Table 4.1: two sensors of equal noise, independent or correlated.

use super::common::{MI, MSE, Pair, arrived, lloyd_system, odd, scene};
use crate::prelude::*;
use fewbits_baselines::quantizer_design as baselines;
use fewbits_quantizer_design::{AtSaddle, Newton, design};

parameters! {
    pub struct Parameters {
        noise_sd: f64 [1e-3..=1e3] = 1.0 => "Noise standard deviation of both sensors, in prior standard deviations.",
        correlation: f64 [-0.99..=0.99] = 0.85 => "Noise correlation of the third case.",
        starts: usize [1..=10_000] = 20 => "Random starts of each joint design.",
    }
}

/// Name, levels, whether correlated, and the printed positive breakpoints of both sensors for each criterion.
type Case = (&'static str, usize, bool, [[&'static [f64]; 2]; 2]);

const EIGHT: [&[f64]; 2] = [&[0.73, 1.51, 2.49], &[0.71, 1.48, 2.48]];
const CASES: [Case; 3] = [
    ("rho0-L4", 4, false, [[&[1.37]; 2], [&[1.39]; 2]]),
    ("rho0-L8", 8, false, [[EIGHT[0]; 2], [EIGHT[1]; 2]]),
    ("rho85-L4", 4, true, [[&[1.15], &[2.1]], [&[1.13], &[2.08]]]),
];

rows! {
    #[derive(Default)]
    pub struct Rows {
        designs: Vec<Row> => "Designs.",
        searches: Vec<Search> => "Random starts of the joint designs.",
    }

    struct Row by "{case} {method} {design}" {
        case: &'static str as panel => "Noise correlation and levels.",
        method: &'static str as ladder("{}-{}") => "Criterion of the design, or the baseline.",
        design: &'static str as ladder => "How it was reached.",
        pair: Pair,
    }

    struct Search {
        case: &'static str => "Noise correlation and levels.",
        criterion: &'static str => "Criterion of the design.",
        starts: usize => "Random starts.",
        arrived: usize => "Starts that reached the best value found.",
        van_trees: Option<f64> => "Van Trees bound at the joint design, independent noise only.",
        printed_primal_mse: Option<f64> => "Printed squared error of problem (4.2).",
    }
}

pub struct Table41;

impl Figure for Table41 {
    figure!(Parameters => Rows, "mi-table4-1", "Two sensors of equal noise", "thesis, Table 4.1",
        "Squared error of two-sensor designs for mutual information and for squared error: the greedy chain, the \
         joint optimum, Lloyd-Max quantizers of the unknown and of the sample, and the printed breakpoints. With \
         independent noise all differences are in the fourth digit. With correlation 0.85 the printed solution is \
         a saddle: the best contiguous pair is asymmetric."; linear("mean squared error / prior variances"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        let newton = Newton::default();
        for (case, levels, correlated, printed) in CASES {
            let as_printed = p.noise_sd == 1.0 && (!correlated || p.correlation == 0.85);
            let print = |key: String| reference::value(&format!("mi-table4-1/{key}")).filter(|_| as_printed);
            let mut push = |method, design, pair: Pair| {
                let pair = pair.beside(print(format!("printed/{case} {method} {design}")));
                rows.designs.push(Row {
                    case,
                    method,
                    design,
                    pair,
                });
            };
            let scene = scene(&[p.noise_sd; 2], if correlated { p.correlation } else { 0.0 })?;
            let sample = lloyd_system(&scene, levels, |n| scene.sample_deviation(n))?;
            for (criterion, method, printed) in [(MI, "mi", printed[0]), (MSE, "mse", printed[1])] {
                context.check()?;
                let greedy = baselines::greedy(&sample, &[0, 1], criterion, &newton)?.swap_remove(1);
                push(method, "greedy", Pair::of(&greedy.system)?);
                let nearest = design::joint(
                    &greedy.system,
                    criterion,
                    &Newton {
                        at_saddle: AtSaddle::Stay,
                        ..Newton::default()
                    },
                )?;
                let best = baselines::multi_start(&sample, criterion, p.starts, 1, &newton)?;
                push(method, if correlated { "symmetric" } else { "joint" }, Pair::joint(&nearest)?);
                if correlated {
                    push(method, "joint", Pair::joint(&best)?);
                }
                push(method, "printed", Pair::of(&odd(&sample, printed)?)?);
                let van_trees = || baselines::bayesian_cramer_rao(&best.system);
                rows.searches.push(Search {
                    case,
                    criterion: method,
                    starts: p.starts,
                    arrived: arrived(&sample, criterion, p.starts, &best),
                    van_trees: (!correlated).then(van_trees).transpose()?,
                    printed_primal_mse: print(format!("printed-primal/{case}")),
                });
            }
            push("lloyd-x", "independent", Pair::of(&lloyd_system(&scene, levels, |_| 1.0)?)?);
            push("lloyd-y", "independent", Pair::of(&sample)?);
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let designs = &rows.designs;
        let find = |key: String| find(designs, &key).map(|r| &r.pair);
        let mse = |case: &str, reached: &str| find(format!("{case} {reached}")).map(|pair| pair.mse);
        claims.keyed("printed", "errors are exact at printed breakpoints", designs, |r| r.pair.mse);
        let curvature = |design: &'static str| {
            let correlated = select(designs, move |r| r.case == "rho85-L4" && r.design == design);
            correlated.map(|r| r.pair.curvature.unwrap_or(f64::NAN))
        };
        let what = "the printed (mirror-symmetric) solution at 0.85 is a saddle (erratum mi-10)";
        here.all("saddle", what, curvature("symmetric"), |c| c > 1e-3);
        let what = "the best pair found at 0.85 is a local optimum";
        claims.all("optimum", what, curvature("joint"), |c| c < 0.0);
        let what = "printed errors of (4.2) without correlation lie below the best any contiguous pair reached, so they are not \
                    exact (erratum mi-6)";
        let independent = || select(&rows.searches, |s| s.case != "rho85-L4");
        claims.shown("printed-primal");
        here.all("primal-too-low", what, independent(), |s| {
            minus(s.printed_primal_mse, mse(s.case, "mse joint")).is_some_and(|gap| gap < 0.0)
        });
        let chain = |case: &str| find(format!("{case} mi greedy")).map(|pair| pair.outer1);
        let what =
            "the greedy chain's first sensor does not depend on correlation, unlike the printed one (erratum mi-5)";
        claims.near("greedy-first", what, minus(chain("rho0-L4"), chain("rho85-L4")), 0.0, 1e-9);
        let loss = |case: &str| (case.to_owned(), minus(mse(case, "mi greedy"), mse(case, "mi joint")));
        let what = "squared error lost by the greedy chain, no correlation";
        claims.references("chain-loss", what, ["rho0-L4", "rho0-L8"], loss);
        let lost = over(mse("rho85-L4", "mi greedy"), mse("rho85-L4", "mi joint")).map(|ratio| ratio - 1.0);
        let what = "at 0.85 the greedy chain costs half a percent: not negligible (erratum mi-6)";
        here.near("rho85-loss", what, lost, 0.00506, 1e-4);
        let what = "without correlation every random start reaches the same optimum";
        here.all("one-optimum", what, independent(), |s| s.arrived == s.starts);
        let what = "squared error >= exp(-2 I) for every design";
        claims.all("shannon", what, designs, |r| r.pair.mse >= (-2.0 * r.pair.mi_nats).exp());
        let what = "no pair's error is below the van Trees bound";
        claims.all("van-trees", what, independent(), |s| {
            minus(mse(s.case, &format!("{} joint", s.criterion)), s.van_trees).is_some_and(|gap| gap > 0.0)
        });
    }
}
