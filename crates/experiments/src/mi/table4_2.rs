//! Table 4.2: two sensors of unequal noise.

use super::common::{MI, MSE, Pair, arrived, lloyd_system, odd, scene};
use crate::prelude::*;
use fewbits_baselines::quantizer_design as baselines;
use fewbits_quantizer_design::{Newton, bounds, design};

parameters! {
    pub struct Parameters {
        noise_variances: Vec<f64> [1e-6..=1e6; 2..=2] = vec![1.0, 0.5] => "Noise variances of the two sensors, in prior variances.",
        starts: usize [1..=10_000] = 30 => "Random starts of each joint design.",
    }
}

/// Levels, and the printed positive breakpoints of both sensors.
const PRINTED: [(usize, [&[f64]; 2]); 2] = [
    (4, [&[1.38], &[1.135]]),
    (8, [&[0.69, 1.45, 2.43], &[0.58, 1.22, 2.05]]),
];

rows! {
    #[derive(Default)]
    pub struct Rows {
        designs: Vec<Row> => "Designs.",
        searches: Vec<Search> => "Random starts of the joint information design.",
    }

    struct Row by "{levels} levels {method}" {
        levels: usize as panel("{} levels") => "Levels of each sensor.",
        method: &'static str as ladder => "Criterion and how it was reached.",
        design: Pair,
    }

    struct Search by "{levels} levels" {
        levels: usize => "Levels of each sensor.",
        starts: usize => "Random starts of the joint information design.",
        arrived: usize => "Starts that reached the best value found.",
        ceo_bound: f64 => "Least squared error of any codes at these rates.",
    }
}

pub struct Table42;

impl Figure for Table42 {
    figure!(Parameters => Rows, "mi-table4-2", "Two sensors of unequal noise", "thesis, Table 4.2",
        "Squared error when one sensor has half the other's noise variance. The printed Lloyd-Max baseline is scaled \
         to the noise; scaled to the sample, as it should be, it beats the mutual-information design.";
        linear("mean squared error / prior variances"));

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let as_printed = p.noise_variances == [1.0, 0.5];
        let mut rows = Rows::default();
        let sds: Vec<f64> = p.noise_variances.iter().map(|v| v.sqrt()).collect();
        let scene = scene(&sds, 0.0)?;
        let newton = Newton::default();
        for (levels, printed) in PRINTED {
            let mut push = |method, design: Pair| {
                let print = reference::value(&format!("mi-table4-2/printed/{levels} levels {method}"));
                let design = design.beside(print.filter(|_| as_printed));
                rows.designs.push(Row { levels, method, design });
            };
            let sample = lloyd_system(&scene, levels, |n| scene.sample_deviation(n))?;
            push("mi-printed", Pair::of(&odd(&sample, printed)?)?);
            for (criterion, greedy, reversed, joint) in [
                (MI, "mi-greedy", "mi-greedy-better-first", "mi-joint"),
                (MSE, "mse-greedy", "mse-greedy-better-first", "mse-joint"),
            ] {
                push(greedy, Pair::of(&baselines::greedy(&sample, &[0, 1], criterion, &newton)?[1].system)?);
                let mut quantizers = baselines::greedy(&sample, &[1, 0], criterion, &newton)?[1]
                    .system
                    .quantizers();
                quantizers.reverse();
                push(reversed, Pair::of(&sample.with_quantizers(quantizers)?)?);
                let best = design::joint(&sample, criterion, &newton)?;
                push(joint, Pair::joint(&best)?);
                if criterion == MI {
                    let bits = (levels as f64).log2();
                    rows.searches.push(Search {
                        levels,
                        starts: p.starts,
                        arrived: arrived(&sample, MI, p.starts, &best),
                        ceo_bound: bounds::ceo(scene.prior(), scene.noise(), &[bits, bits])?.distortion,
                    });
                }
            }
            push("lloyd-noise", Pair::of(&lloyd_system(&scene, levels, |n| sds[n])?)?);
            push("lloyd-x", Pair::of(&lloyd_system(&scene, levels, |_| 1.0)?)?);
            push("lloyd-y", Pair::of(&sample)?);
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let designs = &rows.designs;
        let what = "the printed error is exact to 1.5 % for the designs, 0.6 % for Lloyd-Max (erratum mi-8)";
        claims.keyed("printed", what, designs, |r| r.design.mse);
        for (levels, _) in PRINTED {
            let mse = |method: &str| first(designs, |r| r.levels == levels && r.method == method).map(|r| r.design.mse);
            let what = "squared-error design < Lloyd-Max of the sample < information design, against the printed claim (erratum \
                        mi-7) < the printed baseline, scaled to the noise";
            let order = ["mse-joint", "lloyd-y", "mi-joint", "lloyd-noise"];
            here.increasing(format!("L{levels}-order"), what, order.map(mse));
            let what = "that baseline is worse than Lloyd-Max of the unknown";
            here.increasing(format!("L{levels}-baseline"), what, ["lloyd-x", "lloyd-noise"].map(mse));
        }
        let what = "every random start reaches the same joint optimum";
        here.all("one-optimum", what, &rows.searches, |s| s.arrived == s.starts);
        let bound = |r: &Row| first(&rows.searches, |s| s.levels == r.levels).map(|s| s.ceo_bound);
        claims.all("ceo-gap", "no design beats the bound", designs, |r| bound(r).is_some_and(|b| r.design.mse > b));
    }
}
